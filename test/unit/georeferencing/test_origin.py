"""Points of the map on the Earth, and the files of charts."""

import json
import math
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from georeferencing.adjustment import Adjusted
from georeferencing.asked import AskedOrigin, declination_deg
from georeferencing.chart_files import ChartedPath, geojson, kml
from georeferencing.origin import Origin
from node_support.errors import RefusedInput
from node_support.marks import Mark

pyproj = pytest.importorskip("pyproj", reason="pyproj is not installed")

MARINA = Origin(41.2, 3.1, 12.0)
PATH = ChartedPath("a <bag>", np.array([1.0, 2.0]), np.array([[0.0, 0.0, 0.1], [100.0, 0.0, 0.2]]))
BLOCK = Mark("mooring block", 5.0, -3.0)
SUMMER_OF_2025 = 1.75e9


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        ("41.2, 3.1, azimuth 12", AskedOrigin((41.2, 3.1), 12.0)),
        ("41.2,3.1", AskedOrigin((41.2, 3.1))),
        (" -33.5 , +151 , azimuth -7.5 ", AskedOrigin((-33.5, 151.0), -7.5)),
        ("41.2, 3.1, magnetic", AskedOrigin((41.2, 3.1), is_magnetic=True)),
        ("fixes", AskedOrigin(None)),
        ("fixes, magnetic", AskedOrigin(None, is_magnetic=True)),
        ("fixes, azimuth 12", AskedOrigin(None, 12.0)),
        ("fixes, azimuth unknown", AskedOrigin(None, is_known=False)),
    ],
)
def test_what_is_asked_for_is_read(text, asked):
    assert AskedOrigin.parsed(text) == asked


@pytest.mark.parametrize(
    "text",
    ["", "41.2", "41.2 3.1", "91, 3", "41, 181", "41.2, 3.1, 12", "nan, 3", "41.2, 3.1, azimuth", "fix",
     "41, 3, azimuth unknown"],
)  # fmt: skip
def test_what_is_no_origin_is_refused_with_what_it_must_be(text):
    with pytest.raises(RefusedInput, match="must be"):
        AskedOrigin.parsed(text)


def test_a_magnetic_azimuth_is_turned_by_the_declination_of_day_and_place():
    """15.2 degrees east in Seattle in autumn 2023: example of NOAA's WMM2020, as pygeomag's documents have it."""
    pytest.importorskip("pygeomag", reason="pygeomag is not installed")
    asked = AskedOrigin.parsed("47.6205, -122.3493, magnetic")
    assert asked.origin(1.6961e9).azimuth_deg == pytest.approx(90.0 + 15.26, abs=0.02)
    with pytest.raises(RefusedInput, match="no declination in 1970"):
        asked.origin(0.0)
    with pytest.raises(RefusedInput, match="VERY LARGE"):
        declination_deg(85.8, 139.0, SUMMER_OF_2025)


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
    there = origin.degrees(np.array([[distance, 0.0]]))
    bearing, _, length = pyproj.Geod(ellps="WGS84").inv(longitude, latitude, there[0, 1], there[0, 0])
    assert length == pytest.approx(distance, abs=1e-5)
    assert math.cos(math.radians(bearing - azimuth)) == pytest.approx(1.0)
    np.testing.assert_allclose(origin.points(there), [[distance, 0.0]], atol=1e-6)


def test_a_turned_map_is_less_certain_far_from_its_origin():
    origin = Origin(41.2, 3.1, 90.0, np.diag([1.0, 4.0, 0.01**2]))
    near, far = Adjusted(origin).covariances(np.array([[0.0, 0.0], [300.0, 0.0]]), np.zeros(2))
    np.testing.assert_allclose(near, np.diag([1.0, 4.0]))
    np.testing.assert_allclose(far, np.diag([1.0, 13.0]))


def test_a_map_file_keeps_an_origin():
    origin = Origin(41.2, 3.1, 12.0, np.diag([1.0, 4.0, 0.01]))
    kept = Origin.of_array(origin.array)
    assert kept == origin
    np.testing.assert_array_equal(kept.covariance, origin.covariance)
    with pytest.raises(RefusedInput, match="stored or sent"):
        Origin.of_array(origin.array[:5])


@pytest.mark.parametrize(
    ("origin", "code"), [(MARINA, 32631), (Origin(-33.5, 151.0), 32756), (Origin(0.0, 180.0), 32601)]
)
def test_the_zone_of_utm_is_that_of_the_origin(origin, code):
    assert origin.utm == f"EPSG:{code}"


def test_path_and_marks_are_geojson():
    line, point = json.loads(geojson(MARINA, PATH, [BLOCK]))["features"]
    np.testing.assert_allclose(line["geometry"]["coordinates"], MARINA.degrees(PATH.points)[:, ::-1], atol=1e-8)
    assert line["properties"] == {"name": "a <bag>", "times": [1.0, 2.0]}
    expected = MARINA.degrees(np.array([[BLOCK.x, BLOCK.y]]))[0, ::-1]
    np.testing.assert_allclose(point["geometry"]["coordinates"], expected, atol=1e-8)
    assert point["properties"] == {"name": "mooring block", "x": BLOCK.x, "y": BLOCK.y, "z": BLOCK.z}


def test_path_and_marks_are_placemarks():
    root = ET.fromstring(kml(MARINA, PATH, [BLOCK]))
    space = "{http://www.opengis.net/kml/2.2}"
    line, point = (one.text.split() for one in root.iter(f"{space}coordinates"))
    expected = MARINA.degrees(PATH.points)[:, ::-1]
    np.testing.assert_allclose([[float(one) for one in text.split(",")[:2]] for text in line], expected, atol=1e-8)
    assert len(point) == 1
    assert [one.text for one in root.iter(f"{space}name")] == ["a <bag>", "mooring block"]
