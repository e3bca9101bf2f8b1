"""Where the bins of a beam lie in space."""

import math

import numpy as np
import pytest
from clouds import beam_of
from hypothesis import given
from hypothesis import strategies as st

from node_support.geometry import pose_matrix, wrapped
from sonar_processing.beams.projection import project_beams

ANGLES = st.floats(-7.0, 7.0)
SHIFTS = st.tuples(*[st.floats(-100.0, 100.0)] * 3)


def _pose(shift=(0.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0)):
    return pose_matrix(shift, rotation)


def _projected(beam, pose=None, sides=1, width=0.0436):
    T_target_sonar = _pose() if pose is None else pose
    return project_beams([beam], T_target_sonar[np.newaxis], sides, width)[0]


def test_a_bin_lies_at_its_centre():
    points = _projected(beam_of((1, 2, 3), resolution=0.1))
    np.testing.assert_allclose(points[:, 0], (0.05, 0.15, 0.25), rtol=1e-6)


def test_the_head_turns_counter_clockwise_from_x():
    np.testing.assert_allclose(_projected(beam_of(angle=math.pi / 2))[:, :2], [(0, 0.5), (0, 1.5), (0, 2.5)], atol=1e-6)


def test_strengths_stay_with_their_bins():
    assert _projected(beam_of((7, 0, 255)))[:, 3].tolist() == [7, 0, 255]


def test_a_sonar_tilted_down_sends_its_bins_down():
    points = _projected(beam_of(), _pose((0, 0, -1), (0.0, math.pi / 2, 0.0)))
    np.testing.assert_allclose(points[:, :3], [(0, 0, -1.5), (0, 0, -2.5), (0, 0, -3.5)], atol=1e-6)


@given(ANGLES, SHIFTS, st.tuples(ANGLES, ANGLES, ANGLES))
def test_every_bin_goes_through_the_transform(angle, shift, rotation):
    beam, pose = beam_of(range(20), angle), _pose(shift, rotation)
    expected = [
        pose @ (distance * math.cos(angle), distance * math.sin(angle), 0.0, 1.0) for distance in np.arange(20) + 0.5
    ]
    np.testing.assert_allclose(_projected(beam, pose)[:, :3], np.array(expected)[:, :3], rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("sides", [2, 3, 15])
def test_dispersed_points_spread_evenly_across_the_beams_width(sides):
    points = _projected(beam_of(angle=1.0), sides=sides, width=0.2).reshape(sides, 3, 4)
    headings = np.arctan2(points[..., 1], points[..., 0])
    np.testing.assert_allclose(headings, np.repeat(np.linspace(0.9, 1.1, sides)[:, np.newaxis], 3, axis=1), rtol=1e-6)


@pytest.mark.parametrize("sides", [2, 3, 15])
def test_dispersed_points_keep_range_and_strength(sides):
    points = _projected(beam_of((4, 5, 6)), sides=sides).reshape(sides, 3, 4)
    np.testing.assert_allclose(np.hypot(points[..., 0], points[..., 1]), [[0.5, 1.5, 2.5]] * sides, rtol=1e-6)
    assert points[..., 3].tolist() == [[4, 5, 6]] * sides


def test_one_point_lies_on_the_axis_however_wide_the_beam():
    np.testing.assert_array_equal(_projected(beam_of(), width=0.5), _projected(beam_of(), width=0.0))


@given(st.floats(-100.0, 100.0))
def test_wrapped_angles_point_the_same_way_within_half_a_turn(angle):
    result = wrapped(angle)
    assert -math.pi <= result < math.pi
    assert math.cos(result - angle) == pytest.approx(1.0)
