"""Tracks, scans and planar poses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_scans import at_velocity

from mlsm_manager.scan_matching.scan import Scan, Track
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


def test_the_sign_of_a_stamp_says_whether_the_vehicle_moved():
    track = Track(np.array([0.0, 9.0]), np.zeros((2, 3)))
    scan = Scan.from_stamps(np.zeros((2, 4)), np.array([-3.0, 4.0]), 9.0, track)
    assert scan.times.tolist() == [3.0, 4.0]
    assert scan.moving.tolist() == [False, True]


def test_points_that_are_not_finite_are_left_out_with_their_stamps():
    points = np.array([[0.0, 0, 0, 0], [np.nan, 0, 0, 0], [1.0, 0, 0, np.inf], [2.0, 0, 0, 0]])
    track = Track(np.array([0.0]), np.zeros((1, 3)))
    scan = Scan.from_stamps(points, np.array([1.0, 2.0, 3.0, 4.0]), 9.0, track)
    assert scan.times.tolist() == [1.0, 4.0]
    assert len(scan) == 2


def test_a_scan_refuses_arrays_that_do_not_belong_together():
    track = Track(np.array([0.0]), np.zeros((1, 3)))
    with pytest.raises(RefusedInput):
        Scan(np.zeros((2, 4)), np.zeros(3), np.zeros(2, dtype=bool), track, 0.0)


def test_an_empty_scan_starts_at_its_reference_time():
    track = Track(np.array([0.0]), np.zeros((1, 3)))
    assert Scan.from_stamps(np.empty((0, 4)), np.empty(0), 7.0, track).start == 7.0


def test_points_from_before_the_track_begins_are_left_out():
    track = Track(np.array([2.0, 3.0, 4.0]), np.zeros((3, 3)))
    points, times = np.arange(16.0).reshape(4, 4), np.array([1.0, 1.9, 2.0, 4.0])
    scan = Scan(points, times, np.ones(4, dtype=bool), track, 4.0).with_odometry()
    np.testing.assert_array_equal(scan.points, points[2:])
    np.testing.assert_array_equal(scan.times, times[2:])
    assert len(scan.moving) == 2
