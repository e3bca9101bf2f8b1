"""A scan, its odometry, and the path of the vehicle during it and from scan to scan."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_scans import at_velocity, harbour, scan_of, still
from scipy.spatial import cKDTree

from mlsm_manager.scan_matching.prediction import OdometryErrors, predicted
from mlsm_manager.scan_matching.scan import Belief, Scan, Track
from mlsm_manager.scan_matching.scan_path import STATES, PlanarMotion
from node_support.errors import RefusedInput
from node_support.geometry import composed, inverse, transformed, wrapped

NUMBERS = st.floats(-100.0, 100.0)
POSES = st.tuples(NUMBERS, NUMBERS, st.floats(-3.0, 3.0)).map(np.array)


@given(POSES, POSES)
def test_a_pose_and_its_inverse_cancel(first, second):
    np.testing.assert_allclose(composed(inverse(first), composed(first, second)), second, atol=1e-9)


@given(POSES, POSES, POSES)
def test_points_taken_through_two_poses_or_their_composition_are_the_same(first, second, point):
    point = point[np.newaxis]
    np.testing.assert_allclose(
        transformed(first, transformed(second, point)), transformed(composed(first, second), point), atol=1e-9
    )


@given(st.floats(-50.0, 50.0))
def test_a_wrapped_angle_is_within_half_a_turn_and_points_the_same_way(angle):
    assert -np.pi <= wrapped(angle) < np.pi
    assert np.exp(1j * wrapped(angle)) == pytest.approx(np.exp(1j * angle))


def test_a_track_turns_the_short_way_where_the_heading_wraps():
    track = Track(np.array([0.0, 1.0]), np.array([[0.0, 0.0, 3.1], [0.0, 0.0, -3.1]]))
    assert track.at(0.5)[2] == pytest.approx(np.pi)


def test_a_track_holds_its_ends_beyond_what_it_knows():
    track = Track(np.array([0.0, 1.0]), np.array([[1.0, 2.0, 0.0], [3.0, 4.0, 0.5]]))
    np.testing.assert_array_equal(track.at([-5.0, 9.0]), [[1.0, 2.0, 0.0], [3.0, 4.0, 0.5]])


def test_the_velocity_is_seen_from_the_vehicle():
    times = np.linspace(0.0, 10.0, 101)
    track = Track(times, at_velocity((0.0, 0.3, 0.0), (0.0, 0.0, np.pi / 2.0))(times))
    np.testing.assert_allclose(track.velocity_at(10.0), [0.0, 0.3, 0.0], atol=1e-12)


def test_a_track_of_one_pose_has_no_velocity():
    np.testing.assert_array_equal(Track(np.array([1.0]), np.zeros((1, 3))).velocity_at(1.0), np.zeros(3))


@pytest.mark.parametrize(
    ("times", "poses"),
    [
        ([], np.empty((0, 3))),
        ([0.0, 0.0], np.zeros((2, 3))),
        ([1.0, 0.0], np.zeros((2, 3))),
        ([0.0, np.nan], np.zeros((2, 3))),
        ([0.0], [[np.inf, 0.0, 0.0]]),
        ([0.0, 1.0], np.zeros((1, 3))),
    ],
)
def test_a_track_refuses_what_is_no_way(times, poses):
    with pytest.raises(RefusedInput):
        Track(np.array(times), np.array(poses))


AT_REST = Track(np.array([2.0, 3.0, 4.0]), np.zeros((3, 3)))


def test_the_sign_of_a_stamp_says_whether_the_vehicle_moved():
    scan = Scan.from_stamps(np.zeros((2, 4)), np.array([-3.0, 4.0]), 9.0, AT_REST)
    assert scan.times.tolist() == [3.0, 4.0]
    assert scan.moving.tolist() == [False, True]


def test_points_that_are_not_finite_are_left_out_with_their_stamps():
    points = np.array([[0.0, 0, 0, 0], [np.nan, 0, 0, 0], [1.0, 0, 0, np.inf], [2.0, 0, 0, 0]])
    scan = Scan.from_stamps(points, np.array([1.0, 2.0, 3.0, 4.0]), 9.0, AT_REST)
    assert scan.times.tolist() == [1.0, 4.0]
    assert len(scan) == 2


def test_a_scan_refuses_arrays_that_do_not_belong_together():
    with pytest.raises(RefusedInput):
        Scan(np.zeros((2, 4)), np.zeros(3), np.zeros(2, dtype=bool), AT_REST, 0.0)


def test_an_empty_scan_starts_at_its_reference_time():
    assert Scan.from_stamps(np.empty((0, 4)), np.empty(0), 7.0, AT_REST).start == 7.0


def test_points_from_before_the_track_begins_are_left_out():
    points, times = np.arange(16.0).reshape(4, 4), np.array([1.0, 1.9, 2.0, 4.0])
    scan = Scan(points, times, np.ones(4, dtype=bool), AT_REST, 4.0).with_odometry()
    np.testing.assert_array_equal(scan.points, points[2:])
    np.testing.assert_array_equal(scan.times, times[2:])
    assert len(scan.moving) == 2


STATE = st.tuples(
    *[st.floats(-20.0, 20.0)] * 2, st.floats(-3.0, 3.0), *[st.floats(-0.3, 0.3)] * 2, st.floats(-0.03, 0.03),
    *[st.floats(-0.3, 0.3)] * 2,
).map(np.array)  # fmt: skip
VELOCITIES = st.tuples(*[st.floats(-0.5, 0.5)] * 2, st.sampled_from([-0.03, 0.0, 0.02]))


@given(VELOCITIES, STATE)
def test_the_derivative_of_the_points_is_what_differences_say(velocity, theta):
    motion = PlanarMotion(scan_of(harbour(), at_velocity(velocity)))
    path = motion.path(theta)
    found = motion.point_jacobian(motion.arms(motion.points(path), path), theta)
    for state in range(STATES):
        change = np.zeros(STATES)
        change[state] = 1e-6
        difference = motion.points(motion.path(theta + change)) - motion.points(motion.path(theta - change))
        np.testing.assert_allclose(found[:, :, state], difference / 2e-6, atol=1e-5)


@given(VELOCITIES)
def test_without_odometry_the_rates_are_the_twist(velocity):
    """pose(t) = pose exp(t twist), from the end backwards; the path is made of chords between the beams."""
    truth = at_velocity(velocity)
    motion = PlanarMotion(scan_of(harbour(), still()))
    path = motion.path(np.concatenate([truth(16.0), velocity, [0.0, 0.0]]))
    np.testing.assert_allclose(path, truth(motion.beam_times), atol=1e-3)


@given(VELOCITIES)
def test_an_odometry_that_is_right_needs_no_state_but_the_pose(velocity):
    truth = at_velocity(velocity)
    motion = PlanarMotion(scan_of(harbour(), truth))
    theta = np.concatenate([truth(16.0), np.zeros(5)])
    np.testing.assert_allclose(motion.path(theta), truth(motion.beam_times), atol=1e-3)
    distances, _ = cKDTree(harbour()).query(motion.points(motion.path(theta)))
    np.testing.assert_allclose(distances, 0.0, atol=1e-3)


def test_scale_and_direction_change_the_odometrys_displacements():
    odometry = at_velocity((0.2, 0.0, 0.0))
    motion = PlanarMotion(scan_of(harbour(), odometry))
    theta = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, np.pi / 2.0])
    np.testing.assert_allclose(motion.path(theta)[0], [0.0, -1.5 * 0.2 * 16.0, 0.0], atol=1e-9)


@given(VELOCITIES)
def test_the_belief_follows_the_odometry(velocity):
    truth = at_velocity(velocity)
    track = scan_of(harbour(), truth, start=16.0).track
    before = Belief(16.0, np.concatenate([truth(16.0), np.zeros(5)]), np.zeros((STATES, STATES)))
    after = predicted(before, track, 32.0, OdometryErrors())
    np.testing.assert_allclose(after.theta[:3], truth(32.0), atol=1e-9)


def test_the_farther_the_vehicle_went_the_less_sure_its_place_is():
    track, times = scan_of(harbour(), at_velocity((0.3, 0.0, 0.0)), start=16.0).track, np.array([8.0, 16.0, 32.0])
    errors = OdometryErrors(scale_deviation=0.2, speed_deviation=0.0)
    before = Belief(0.0, np.zeros(STATES), errors.covariance())
    deviations = [np.sqrt(predicted(before, track, time, errors).covariance[0, 0]) for time in times]
    np.testing.assert_allclose(deviations, 0.2 * 0.3 * times, rtol=1e-3)


def test_a_scale_that_was_found_corrects_the_way_from_then_on():
    track = scan_of(harbour(), at_velocity((0.2, 0.0, 0.0))).track
    theta = np.zeros(STATES)
    theta[6] = 0.3
    after = predicted(Belief(0.0, theta, np.zeros((STATES, STATES))), track, 16.0, OdometryErrors())
    np.testing.assert_allclose(after.theta[0], 1.3 * 0.2 * 16.0, rtol=0.01)


def test_an_error_of_the_speed_fades_and_what_fades_becomes_unknown():
    track = scan_of(harbour(), still()).track
    errors = OdometryErrors(rate_correlation_time=16.0)
    theta = np.array([0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0])
    after = predicted(Belief(0.0, theta, np.zeros((STATES, STATES))), track, 16.0, errors)
    np.testing.assert_allclose(after.theta[3], 0.1 / np.e)
    np.testing.assert_allclose(after.covariance[3, 3], errors.speed_deviation**2 * (1.0 - np.exp(-2.0)))
