"""What beams and clouds refuse to be, and what they hold."""

import math

import numpy as np
import pytest
from clouds import cloud_of

from node_support.errors import RefusedInput
from sonar_processing.beams.beam import Beam
from sonar_processing.cloud import Cloud


def _beam(bins=3, **values):
    defaults = {"stamp_ns": 1, "frame_id": "sonar", "angle": 0.0, "range_resolution": 0.1}
    return Beam(intensities=np.zeros(bins, dtype=np.uint8), **{**defaults, **values})


@pytest.mark.parametrize("bins", [0, 4097, 10000])
def test_a_beam_has_1_to_4096_bins(bins):
    with pytest.raises(RefusedInput, match=f"^{bins} bins, must be 1 to 4096") as refused:
        _beam(bins)
    assert refused.value.kind == "beams refused"


@pytest.mark.parametrize("bins", [1, 4096])
def test_the_first_and_the_last_allowed_number_of_bins_are_taken(bins):
    assert len(_beam(bins).ranges) == bins


@pytest.mark.parametrize("resolution", [0.0, -0.1, math.nan, math.inf])
def test_bins_have_a_length(resolution):
    with pytest.raises(RefusedInput, match=f"range_resolution {resolution}"):
        _beam(range_resolution=resolution)


@pytest.mark.parametrize("resolution", [2.51, 1e6, 1e30, 1e308])
def test_a_beam_reaches_10_km_at_most(resolution):
    with pytest.raises(RefusedInput, match="must be at most 10000 m") as refused:
        _beam(4000, range_resolution=resolution)
    assert refused.value.kind == "beams refused"


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", ["angle", "sensor_angle"])
def test_head_and_servo_point_somewhere(name, value):
    with pytest.raises(RefusedInput, match=str(value)):
        _beam(**{name: value})


def test_a_beam_without_a_frame_is_refused():
    with pytest.raises(RefusedInput, match="frame_id is empty"):
        _beam(frame_id="")


def test_ranges_are_those_of_the_bins_centres():
    np.testing.assert_allclose(_beam(4, range_resolution=0.5).ranges, (0.25, 0.75, 1.25, 1.75))


@pytest.mark.parametrize("stamps", [0, 2, 4])
def test_a_cloud_has_as_many_stamps_as_points(stamps):
    with pytest.raises(RefusedInput, match=f"3 points but {stamps} time stamps") as refused:
        Cloud(np.zeros((3, 4), dtype=np.float32), np.zeros(stamps), 0, "odom")
    assert refused.value.kind == "clouds refused"


@pytest.mark.parametrize("height", [0, -1, 4])
def test_the_points_of_a_cloud_fill_its_rows(height):
    with pytest.raises(RefusedInput, match=f"6 points do not fill {height} rows"):
        cloud_of([1] * 6, height)


@pytest.mark.parametrize("column", range(4))
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_point_with_a_value_that_is_not_finite_is_not_valid(column, value):
    cloud = cloud_of([1, 2, 3])
    cloud.points[1, column] = value
    assert cloud.valid.tolist() == [True, False, True]


def test_a_point_with_a_stamp_that_is_not_finite_is_not_valid():
    cloud = cloud_of([1, 2, 3])
    cloud.time_stamps[0] = np.nan
    assert cloud.valid.tolist() == [False, True, True]


def test_points_beyond_a_limit_are_told_from_those_that_were_removed():
    cloud = cloud_of([1, 2, 3, 4, 5])
    cloud.points[:, 1] = 100.0, -100.1, 3e38, np.nan, -np.inf
    assert cloud.beyond(100.0).tolist() == [False, True, True, False, True]


def test_selected_points_keep_their_stamps():
    selected = cloud_of([10, 20, 30]).select(np.array([True, False, True]))
    assert selected.points[:, 3].tolist() == [10, 30]
    assert selected.time_stamps.tolist() == [1, 3]


def test_an_organised_cloud_keeps_its_shape_when_points_are_selected():
    selected = cloud_of([10, 20, 30, 40], height=2).select(np.array([True, False, True, False]))
    assert selected.is_organized
    assert np.isnan(selected.points[:, 0]).tolist() == [False, True, False, True]
    assert selected.time_stamps.tolist() == [1, 2, 3, 4]
    assert selected.points.dtype == np.float32
