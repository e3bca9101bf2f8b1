"""Compasses that publish a single number."""

import numpy as np
import pytest

from dead_reckoning.dead_reckoner import rotation_of_heading
from dead_reckoning.parameters import HeadingType
from node_support.errors import RefusedInput

AHEAD = np.array([1.0, 0.0, 0.0])
EAST, NORTH = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("heading", "ahead"), [(0.0, NORTH), (90.0, EAST), (180.0, -NORTH), (270.0, -EAST), (-90.0, -EAST)]
)
def test_headings_count_clockwise_from_north(heading, ahead):
    np.testing.assert_allclose(rotation_of_heading(heading, HeadingType.COMPASS_DEGREES) @ AHEAD, ahead, atol=1e-12)
    in_radians = rotation_of_heading(np.radians(heading), HeadingType.COMPASS_RADIANS)
    np.testing.assert_allclose(in_radians @ AHEAD, ahead, atol=1e-12)


def test_left_stays_left():
    left = np.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose(rotation_of_heading(0.0, HeadingType.COMPASS_DEGREES) @ left, -EAST, atol=1e-12)


@pytest.mark.parametrize("heading", [np.nan, np.inf, -np.inf, 721.0])
def test_what_is_no_heading_is_refused_with_its_value(heading):
    with pytest.raises(RefusedInput, match=f"{heading} deg"):
        rotation_of_heading(heading, HeadingType.COMPASS_DEGREES)


def test_degrees_that_are_taken_for_radians_are_refused():
    with pytest.raises(RefusedInput, match=r"200.0 rad, must be .* see heading_type"):
        rotation_of_heading(200.0, HeadingType.COMPASS_RADIANS)
