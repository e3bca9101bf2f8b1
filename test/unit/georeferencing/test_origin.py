"""Points of the map on the Earth, and the files of charts."""

import json
import math
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from georeferencing.chart_files import write_chart
from georeferencing.origin import Origin
from node_support.errors import RefusedInput

MARINA = Origin(41.2, 3.1, 12.0)


@pytest.mark.parametrize(
    ("text", "origin"),
    [
        ("41.2, 3.1, azimuth 12", MARINA),
        ("41.2,3.1", Origin(41.2, 3.1, 90.0)),
        (" -33.5 , +151 , azimuth -7.5 ", Origin(-33.5, 151.0, -7.5)),
    ],
)
def test_an_origin_is_read(text, origin):
    assert Origin.parsed(text) == origin


@pytest.mark.parametrize(
    "text", ["", "41.2", "41.2 3.1", "91, 3", "41, 181", "41.2, 3.1, 12", "nan, 3", "41.2, 3.1, azimuth"]
)
def test_what_is_no_origin_is_refused_with_its_text(text):
    with pytest.raises(RefusedInput, match="must be"):
        Origin.parsed(text)


def test_the_origin_is_where_it_was_said():
    np.testing.assert_allclose(MARINA.degrees(np.zeros((1, 2))), [[41.2, 3.1]], atol=1e-12)


def test_a_degree_is_as_long_as_on_the_ellipsoid():
    """At 45 degrees a degree of latitude is 111,131.78 m long, one of longitude 78,846.81 m (WGS 84)."""
    (north, east) = Origin(45.0, 0.0).degrees(np.array([[0.0, 111.13178], [78.84681, 0.0]]))
    np.testing.assert_allclose(north, [45.001, 0.0], atol=1e-8)
    np.testing.assert_allclose(east, [45.0, 0.001], atol=1e-8)


@given(st.floats(-80.0, 80.0), st.floats(-179.0, 179.0), st.floats(-180.0, 180.0), st.floats(1.0, 2000.0))
def test_distances_on_the_chart_are_those_in_the_map(latitude, longitude, azimuth, distance):
    origin = Origin(latitude, longitude, azimuth)
    (there,) = origin.degrees(np.array([[distance, 0.0]]))
    north = math.radians(there[0] - latitude)
    east = math.radians(there[1] - longitude) * math.cos(math.radians(latitude))
    # The Earth's radii of curvature differ by 1 %.
    assert math.hypot(north, east) * 6371e3 == pytest.approx(distance, rel=0.01)
    assert math.cos(math.atan2(east, north) - math.radians(azimuth)) > 0.999


def test_the_path_is_written_for_charts(tmp_path):
    times, poses = np.array([1.0, 2.0]), np.array([[0.0, 0.0, 0.1], [100.0, 0.0, 0.2]])
    write_chart(tmp_path, "a <bag>", MARINA, times, poses)
    line = json.loads((tmp_path / "path.geojson").read_text())["features"][0]
    expected = MARINA.degrees(poses)[:, ::-1]
    np.testing.assert_allclose(line["geometry"]["coordinates"], expected, atol=1e-8)
    root = ET.parse(str(tmp_path / "path.kml")).getroot()
    (coordinates,) = root.iter("{http://www.opengis.net/kml/2.2}coordinates")
    np.testing.assert_allclose(
        [[float(value) for value in point.split(",")[:2]] for point in coordinates.text.split()], expected, atol=1e-8
    )
    table = np.loadtxt(str(tmp_path / "path.csv"), delimiter=",", skiprows=1)
    np.testing.assert_allclose(table, np.column_stack([times, expected[:, ::-1]]), atol=1e-8)
