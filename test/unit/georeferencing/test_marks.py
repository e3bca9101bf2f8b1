"""Marks as GeoJSON: on the Earth where the origin is known, else in metres of the map, which the file says."""

import json

import pytest

from georeferencing.chart_files import marks_geojson
from georeferencing.origin import Origin
from node_support.errors import RefusedInput
from node_support.marks import MOST_MARKS, Mark, Marks

BLOCK = Mark('mooring "block" ⚓', 100.0, 0.0, -3.0)


def test_with_an_origin_marks_have_longitude_and_latitude():
    file = json.loads(marks_geojson([BLOCK], Origin(41.0, 3.0)))
    longitude, latitude = file["features"][0]["geometry"]["coordinates"]
    assert latitude == pytest.approx(41.0, abs=1e-5)
    # 100 m east; a degree has 84 km there.
    assert longitude - 3.0 == pytest.approx(100.0 / 84_140.0, rel=1e-3)
    assert file["features"][0]["properties"] == {"name": BLOCK.name, "x": 100.0, "y": 0.0, "z": -3.0}
    assert "coordinates" not in file


def test_without_an_origin_they_are_in_metres_and_the_file_says_so():
    file = json.loads(marks_geojson([BLOCK], None))
    assert file["features"][0]["geometry"]["coordinates"] == [100.0, 0.0]
    assert "metres of the map" in file["coordinates"]


def test_no_marks_are_a_file_too():
    assert json.loads(marks_geojson([], Origin(41.0, 3.0)))["features"] == []


def test_a_name_stands_for_one_place():
    marks = Marks([BLOCK])
    marks.set(Mark(BLOCK.name, 1.0, 2.0))
    assert marks.all() == [Mark(BLOCK.name, 1.0, 2.0)]
    marks.delete(BLOCK.name)
    assert marks.all() == []
    with pytest.raises(RefusedInput, match="no mark"):
        marks.delete(BLOCK.name)


def test_marks_are_bounded():
    marks = Marks(Mark(str(number), 0.0, 0.0) for number in range(MOST_MARKS))
    marks.set(Mark("0", 1.0, 1.0))
    with pytest.raises(RefusedInput, match="delete some"):
        marks.set(Mark("one more", 0.0, 0.0))
