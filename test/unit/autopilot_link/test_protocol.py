"""The autopilot's axes, its clock, and what counts as a jump."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot_link.parameters import AutopilotLinkParameters
from autopilot_link.protocol import (
    AutopilotClock,
    Corrections,
    StatedPose,
    enu_of_map,
    full_covariance,
    rotation_of_attitude,
    velocity_between,
    velocity_of_ned,
)
from node_support.errors import RefusedInput
from node_support.geometry import matrices, pose_matrix

ANGLES = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
PARAMETERS = AutopilotLinkParameters()
SECOND, MILLISECOND = 10**9, 10**6


def _stated(pose, covariance=None):
    covariance = np.eye(6) if covariance is None else covariance
    return StatedPose(0, pose, np.array([1.0, 2.0, 3.0]), covariance, 0)


def test_east_north_up_becomes_north_east_down():
    pose = _stated(pose_matrix((1.0, 2.0, -3.0), (0.0, 0.0, math.pi / 2)))
    np.testing.assert_allclose(pose.in_ned[:3, 3], [2.0, 1.0, 3.0])
    np.testing.assert_allclose(pose.roll_pitch_yaw, 0.0, atol=1e-12)
    np.testing.assert_allclose(pose.velocity_frd, [1.0, -2.0, -3.0])


@given(ANGLES)
def test_an_attitude_comes_back_as_it_was_sent(angles):
    pose = np.eye(4)
    pose[:3, :3] = rotation_of_attitude(*angles)
    np.testing.assert_allclose(_stated(pose).roll_pitch_yaw, angles, atol=1e-6)


def test_a_vehicle_that_heads_north_and_rolls_to_the_right_has_its_left_side_up():
    np.testing.assert_allclose(
        rotation_of_attitude(math.pi / 2, 0.0, 0.0) @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], atol=1e-12
    )


@given(ANGLES)
def test_a_velocity_over_ground_is_the_one_along_the_vehicle_turned(angles):
    ahead = velocity_of_ned((3.0, 4.0, 0.0), rotation_of_attitude(*angles))
    assert np.linalg.norm(ahead) == pytest.approx(5.0)
    eastward = velocity_of_ned((0.0, 2.0, 0.0), rotation_of_attitude(0.0, 0.0, math.pi / 2))
    np.testing.assert_allclose(eastward, [2.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("broken", [math.nan, math.inf])
def test_what_is_not_finite_is_refused(broken):
    with pytest.raises(RefusedInput, match="must be finite"):
        rotation_of_attitude(0.0, broken, 0.0)
    with pytest.raises(RefusedInput, match="must be finite"):
        velocity_of_ned((0.0, broken, 0.0), np.eye(3))


def test_the_maps_x_axis_points_where_the_azimuth_says():
    """Towards 120 degrees from north: east by half the root of 3, south by a half."""
    direction = enu_of_map(120.0)[:3, 0]
    np.testing.assert_allclose(direction, [math.sqrt(0.75), -0.5, 0.0], atol=1e-12)


def test_the_covariance_is_stated_in_the_autopilots_order_and_axes():
    planar = np.array([[4.0, 0.5, 0.1], [0.5, 1.0, 0.2], [0.1, 0.2, 0.09]])
    triangle = _stated(np.eye(4), full_covariance(planar, PARAMETERS)).covariance_ned
    full = np.zeros((6, 6))
    full[np.triu_indices(6)] = triangle
    north_east_yaw = full[np.ix_([0, 1, 5], [0, 1, 5])]
    np.testing.assert_allclose(north_east_yaw, [[1.0, 0.5, -0.2], [0.0, 4.0, -0.1], [0.0, 0.0, 0.09]])
    assert full[2, 2] == pytest.approx(PARAMETERS.depth_deviation**2)


@given(st.floats(-180.0, 180.0))
def test_turning_the_map_keeps_what_is_known(azimuth):
    planar = np.array([[4.0, 0.5, 0.1], [0.5, 1.0, 0.2], [0.1, 0.2, 0.09]])
    turned = full_covariance(planar, PARAMETERS.changed({"map_azimuth_deg": azimuth}))
    assert np.linalg.det(turned[:2, :2]) == pytest.approx(np.linalg.det(planar[:2, :2]))
    assert turned[5, 5] == pytest.approx(0.09)


def test_the_velocity_is_where_the_odometry_went_and_unknown_after_it_leapt():
    north = pose_matrix((0.0, 0.0, 0.0), (0.0, 0.0, math.pi / 2))
    later = pose_matrix((0.0, 0.1, 0.0), (0.0, 0.0, math.pi / 2))
    np.testing.assert_allclose(velocity_between(north, later, 0.2), [0.5, 0.0, 0.0], atol=1e-12)
    assert np.isnan(velocity_between(north, pose_matrix((30.0, 0.0, 0.0)), 0.2)).all()
    assert np.isnan(velocity_between(north, later, 5.0)).all()


def _asked(clock, now, offset, there, back):
    """Ask at `now` [ns]; the answer of a clock `offset` ahead takes `there` and `back` [ns]."""
    clock.request(now)
    clock.take_answer(now, now + there + offset, now + there + back)


@given(st.lists(st.tuples(st.integers(0, 10**8), st.integers(0, 10**8)), min_size=1, max_size=10))
def test_the_offset_is_right_to_half_the_shortest_round_trip(trips):
    clock, offset = AutopilotClock(), -1234 * SECOND
    for number, (there, back) in enumerate(trips):
        _asked(clock, number * SECOND, offset, there, back)
    assert abs(clock.offset_ns - offset) <= min(there + back for there, back in trips) // 2 + 1
    assert clock.jumps == 0


def test_an_autopilot_that_starts_anew_has_a_new_offset():
    clock = AutopilotClock()
    assert clock.offset_ns is None
    _asked(clock, 0, 5000 * SECOND, MILLISECOND, MILLISECOND)
    _asked(clock, SECOND, -SECOND, 4 * MILLISECOND, MILLISECOND)
    assert clock.jumps == 1
    assert clock.offset_ns == pytest.approx(-SECOND, abs=3 * MILLISECOND)


def test_answers_to_others_and_late_ones_tell_nothing():
    clock = AutopilotClock()
    clock.take_answer(17, 1, 20)
    assert clock.offset_ns is None
    with pytest.raises(RefusedInput, match=r"round trip 2\.000 s"):
        _asked(clock, 0, 0, SECOND, SECOND)


@pytest.mark.parametrize(
    ("steps", "sent"),
    [
        (
            [(0, 0.0, None), (1, 1.0, 5.0), (2, 3.0, None), (3, 4.9, None), (4, 5.0, None)],
            [(0.0, 0), (5.0, 1), (5.0, 1), (4.9, 1), (5.0, 1)],
        ),
        ([(0, 0.0, None), (1, 0.1, 0.4), (2, 0.4, None)], [(0.0, 0), (0.4, 0), (0.4, 0)]),
        ([(0, 0.0, None), (1, 0.0, 9.0), (7, 0.0, None)], [(0.0, 0), (9.0, 1), (0.0, 2)]),
    ],
    ids=["far away: one jump though tf glides to it", "nearby: no jump", "tf never comes to it: forgotten"],
)
def test_a_fix_is_sent_at_once_and_counts_as_a_jump_where_it_is_far_away(steps, sent):
    """Steps are (stamp [s], tf's correction x [m], that of a fix or None), what is sent x [m] and the jumps so far."""
    corrections = Corrections()
    for (stamp, by_tf, fix), expected in zip(steps, sent):
        if fix is not None:
            corrections.take_fix(stamp * SECOND, matrices(np.array([fix, 0.0, 0.0])))
        pose = corrections.corrected(stamp * SECOND, matrices(np.array([by_tf, 0.0, 0.0])), np.eye(4), PARAMETERS)
        assert (pose[0, 3], corrections.jumps) == expected


def test_a_turn_is_a_jump_too():
    corrections, limit = Corrections(), math.radians(PARAMETERS.jump_angle_deg)
    for turn, jumps in ((0.0, 0), (0.9 * limit, 0), (2.0 * limit, 1)):
        corrections.corrected(0, matrices(np.array([0.0, 0.0, turn])), np.eye(4), PARAMETERS)
        assert corrections.jumps == jumps
