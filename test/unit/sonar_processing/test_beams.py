"""What beams and clouds refuse to be and hold; where the bins of a beam lie, and how its errors are put right."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from clouds import beam_of, cloud_of
from hypothesis import given
from hypothesis import strategies as st

from node_support.errors import RefusedInput
from node_support.geometry import pose_matrix
from node_support.parameters import ParameterError
from sonar_processing.beams.beam import Beam, PlacedBeam, beam_directions, project_beams
from sonar_processing.beams.parameters import BeamCorrection, SonarPoseParameters
from sonar_processing.cloud import Cloud

ANGLES = st.floats(-7.0, 7.0)
SHIFTS = st.tuples(*[st.floats(-100.0, 100.0)] * 3)
NO_ANGLES = (math.nan, math.inf, -math.inf, -2e6, 1e300)
BEAM = Beam(5_000_000_001, "sonar", 0.1, np.arange(4, dtype=np.uint8), 0.5)
IDENTITY = np.eye(4)


def _beam(bins=3, **values):
    defaults = {"stamp_ns": 1, "frame_id": "sonar", "angle": 0.0, "range_resolution": 0.1}
    return Beam(intensities=np.zeros(bins, dtype=np.uint8), **{**defaults, **values})


@given(ANGLES, ANGLES, ANGLES)
def test_a_level_sonar_that_is_turned_hears_where_its_head_would_point_otherwise(angle, yaw, turn):
    placed = PlacedBeam(replace(BEAM, angle=angle), pose_matrix((1.0, 2.0, 3.0), (0.0, 0.0, yaw)), False)
    turned = placed.turned(turn).T_target_sonar
    expected = beam_directions(np.array(angle + turn), placed.T_target_sonar)
    np.testing.assert_allclose(beam_directions(np.array(angle), turned), expected, atol=1e-9)
    np.testing.assert_array_equal(turned[:, 3], placed.T_target_sonar[:, 3])


@pytest.mark.parametrize(
    ("values", "text"),
    [
        *(({"bins": bins}, f"^{bins} bins, must be 1 to 4096") for bins in (0, 4097, 10000)),
        *(({"range_resolution": one}, f"range_resolution {one}") for one in (0.0, -0.1, math.nan, math.inf)),
        *(({"bins": 4000, "range_resolution": one}, "must be at most 10000 m") for one in (2.51, 1e6, 1e30, 1e308)),
        *(({"angle": one}, re.escape(str(one))) for one in NO_ANGLES),
        *(({"sensor_angle": one}, re.escape(str(one))) for one in NO_ANGLES),
        ({"frame_id": ""}, "frame_id is empty"),
    ],
)
def test_a_beam_that_cannot_be_placed_is_refused(values, text):
    with pytest.raises(RefusedInput, match=text) as refused:
        _beam(**values)
    assert refused.value.kind == "beams refused"


@pytest.mark.parametrize("bins", [1, 4096])
def test_the_first_and_the_last_allowed_number_of_bins_are_taken(bins):
    assert len(_beam(bins).ranges) == bins


@pytest.mark.parametrize("stamps", [0, 2, 4])
def test_a_cloud_has_as_many_stamps_as_points(stamps):
    with pytest.raises(RefusedInput, match=f"3 points but {stamps} time stamps") as refused:
        Cloud(np.zeros((3, 4), dtype=np.float32), np.zeros(stamps), 0, "odom")
    assert refused.value.kind == "clouds refused"


@pytest.mark.parametrize("height", [0, -1, 4])
def test_the_points_of_a_cloud_fill_its_rows(height):
    with pytest.raises(RefusedInput, match=f"6 points do not fill {height} rows"):
        cloud_of([1] * 6, height)


@pytest.mark.parametrize("column", range(5))
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_point_with_a_value_or_a_stamp_that_is_not_finite_is_not_valid(column, value):
    cloud = cloud_of([1, 2, 3])
    [*cloud.points.T, cloud.time_stamps][column][1] = value
    assert cloud.valid.tolist() == [True, False, True]


def test_points_beyond_a_limit_are_told_from_those_that_were_removed():
    cloud = cloud_of([1, 2, 3, 4, 5])
    cloud.points[:, 1] = 100.0, -100.1, 3e38, np.nan, -np.inf
    assert cloud.beyond(100.0).tolist() == [False, True, True, False, True]


def _projected(beam, pose=IDENTITY, sides=1, width=0.0436):
    return project_beams([beam], pose[np.newaxis], sides, width)[0]


@given(ANGLES, SHIFTS, st.tuples(ANGLES, ANGLES, ANGLES))
def test_every_bin_goes_through_the_transform(angle, shift, rotation):
    beam, pose = beam_of(range(20), angle), pose_matrix(shift, rotation)
    expected = [pose @ (apart * math.cos(angle), apart * math.sin(angle), 0.0, 1.0) for apart in np.arange(20) + 0.5]
    np.testing.assert_allclose(_projected(beam, pose)[:, :3], np.array(expected)[:, :3], rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize(("sides", "first"), [(1, 1.0), (2, 0.9), (3, 0.9), (15, 0.9)])
def test_dispersed_points_spread_evenly_across_the_beams_width_and_keep_range_and_strength(sides, first):
    points = _projected(beam_of((4, 5, 6), angle=1.0), sides=sides, width=0.2).reshape(sides, 3, 4)
    headings = np.repeat(np.linspace(first, 2.0 - first, sides)[:, np.newaxis], 3, axis=1)
    np.testing.assert_allclose(np.arctan2(points[..., 1], points[..., 0]), headings, rtol=1e-6)
    np.testing.assert_allclose(np.hypot(points[..., 0], points[..., 1]), [[0.5, 1.5, 2.5]] * sides, rtol=1e-6)
    assert points[..., 3].tolist() == [[4, 5, 6]] * sides


@pytest.mark.parametrize(
    ("angle", "mounting", "expected"),
    [
        (0.0, {}, (0.5, 0.0, 0.0)),
        (math.pi / 2, {}, (0.0, 0.5, 0.0)),
        (0.0, {"mount_yaw": math.pi / 2}, (0.0, 0.5, 0.0)),
        (math.pi / 2, {"upside_down": True}, (0.0, -0.5, 0.0)),
        (math.pi / 2, {"upside_down": True, "mount_yaw": math.pi / 2}, (0.5, 0.0, 0.0)),
        (0.0, {"mount_x": 1.0, "mount_y": -2.0, "mount_z": 3.0}, (1.5, -2.0, 3.0)),
    ],
)
def test_angle_0_points_along_mount_yaw_and_an_upside_down_head_turns_the_other_way(angle, mounting, expected):
    first_bin = _projected(beam_of(angle=angle), SonarPoseParameters(**mounting).matrix())[0, :3]
    np.testing.assert_allclose(first_bin, expected, atol=1e-6)


def test_a_mounting_out_of_range_is_refused():
    with pytest.raises(ParameterError, match="mount_x"):
        SonarPoseParameters(mount_x=1000.0)


def test_the_delay_is_added_to_the_nanosecond():
    assert BeamCorrection(sonar_delay=0.25).corrected(BEAM).stamp_ns == 5_250_000_001
    assert BeamCorrection(sonar_delay=-5.0).corrected(BEAM).stamp_ns == 1


def test_the_rest_of_the_beam_stays():
    found = BeamCorrection(1.0, 1.1).corrected(BEAM)
    assert (found.frame_id, found.angle, found.sensor_angle) == (BEAM.frame_id, BEAM.angle, BEAM.sensor_angle)
    np.testing.assert_array_equal(found.intensities, BEAM.intensities)


def test_a_beam_before_time_0_is_refused():
    with pytest.raises(RefusedInput, match=r"stamp -5\.000 s, below 0; check sonar_delay"):
        BeamCorrection(sonar_delay=-10.0).corrected(BEAM)
