"""The correction map -> odom: between scans without jumps, and for points of the past."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_scans import at_velocity, still

from mlsm_manager.localisation.clouds import CorrectionHistory
from mlsm_manager.localisation.following import LiveCorrection
from mlsm_manager.scan_matching.scan import Belief, Fading, MapCloud, Track

TIMES = np.arange(0.0, 10.0, 0.1)


def belief_of(time, pose, *errors):
    theta = np.zeros(8)
    theta[:3] = pose
    theta[3 : 3 + len(errors)] = errors
    return Belief(time, theta, np.zeros((8, 8)))


def cloud_at(times):
    times = np.array(times, dtype=float)
    return MapCloud(np.zeros((len(times), 4)), times, float(times[-1]))


def history_of(*stretches):
    history = CorrectionHistory()
    for start, end, x, holds in stretches:
        times = np.linspace(start, end, 5)
        poses = np.column_stack([np.full(5, x), np.zeros((5, 2))])
        history.add(times, poses, Track(TIMES, np.zeros((100, 3))), holds)
    return history


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0))
def test_after_the_blend_the_pose_is_the_believed_one(x, y, yaw):
    correction = LiveCorrection(1.0)
    correction.sample(0.0, np.zeros(3))
    correction.believe(belief_of(0.0, [x, y, yaw]))
    for time in (0.1, 0.6, 1.2):
        found = correction.sample(time, np.zeros(3))
    np.testing.assert_allclose(found, [x, y, yaw], atol=1e-9)


def test_a_new_fix_is_approached_without_a_jump():
    correction = LiveCorrection(1.0)
    correction.believe(belief_of(0.0, np.zeros(3)))
    before = [correction.sample(time, np.zeros(3))[0] for time in TIMES[:50]]
    correction.believe(belief_of(TIMES[49], [1.0, 0.0, 0.0]))
    after = [correction.sample(time, np.zeros(3))[0] for time in TIMES[50:]]
    steps = np.abs(np.diff(before + after))
    assert steps.max() < 0.11
    assert after[-1] == pytest.approx(1.0)


def test_a_fix_of_the_past_is_brought_to_now_by_the_odometry():
    odometry = at_velocity((0.5, 0.0, 0.0))
    correction = LiveCorrection(0.0)
    for time in TIMES[:50]:
        correction.sample(time, odometry(time))
    correction.believe(belief_of(2.0, odometry(2.0) + np.array([0.0, 3.0, 0.0])))
    np.testing.assert_allclose(correction.sample(TIMES[50], odometry(TIMES[50])), [0.0, 3.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("sampled_until", [1.9, 1.5, 0.0])
def test_a_fix_newer_than_the_odometry_is_advanced_from_its_own_time_on(sampled_until):
    """The fix is of 2 s; the first odometry after it is of 2.3 s."""
    odometry = at_velocity((0.5, 0.0, 0.0))
    correction = LiveCorrection(0.0)
    for time in (0.0, sampled_until):
        correction.sample(time, odometry(time))
    correction.believe(belief_of(2.0, odometry(2.0) + np.array([0.0, 3.0, 0.0]), 0.2))
    np.testing.assert_allclose(correction.sample(2.3, odometry(2.3)), [0.2 * 0.3, 3.0, 0.0], atol=1e-9)


def test_an_error_of_the_speed_that_was_found_goes_on():
    correction = LiveCorrection(0.0)
    correction.believe(belief_of(0.0, np.zeros(3), 0.2))
    found = [correction.sample(time, np.zeros(3))[0] for time in TIMES]
    np.testing.assert_allclose(found, 0.2 * TIMES, atol=1e-9)


def with_fading(time, pose, speed, usual):
    belief = belief_of(time, pose, speed)
    return replace(belief, fading=Fading(np.array([usual, 0.0, 0.0]), np.full(3, 20.0)))


def test_a_speed_that_fades_goes_on_as_it_is_expected():
    """From 0.4 towards 0.1 m/s within 20 s, and not along with what the odometry says."""
    correction, times = LiveCorrection(0.0), np.arange(0.0, 14.0, 0.1)
    correction.believe(with_fading(0.0, np.zeros(3), 0.4, 0.1))
    found = [correction.sample(time, np.zeros(3))[0] for time in times]
    np.testing.assert_allclose(found, 0.1 * times + 0.3 * 20.0 * (1.0 - np.exp(-times / 20.0)), atol=1e-4)


def test_a_fix_of_the_past_is_brought_to_now_as_its_speed_fades():
    at_once, later = LiveCorrection(0.0), LiveCorrection(0.0)
    belief = with_fading(2.0, np.array([1.0, 2.0, 0.5]), 0.4, 0.1)
    at_once.believe(belief)
    for time in TIMES[20:]:
        expected = at_once.sample(time, np.zeros(3))
    for time in TIMES[:-1]:
        later.sample(time, np.zeros(3))
    later.believe(belief)
    np.testing.assert_allclose(later.sample(TIMES[-1], np.zeros(3)), expected, atol=1e-9)


def test_without_a_new_fix_the_vehicle_comes_to_rest():
    """With a fix every 10 s, one is overdue after 20 s; from then on 0.2 m/s fade within 20 s: 4 m."""
    correction, times = LiveCorrection(0.0), np.arange(0.0, 300.0, 0.5)
    found = []
    for time in times:
        found.append(correction.sample(time, np.zeros(3))[0])
        if time in (0.0, 10.0, 20.0):
            correction.believe(with_fading(time, np.array([0.2 * time, 0.0, 0.0]), 0.2, 0.2))
    assert found[80] == pytest.approx(8.0)
    assert found[-1] == pytest.approx(12.0, abs=0.1)


def test_a_time_that_does_not_increase_changes_nothing():
    correction = LiveCorrection(0.0)
    correction.believe(belief_of(0.0, np.zeros(3), 0.2))
    for time in TIMES[:20]:
        expected = correction.sample(time, np.zeros(3))
    np.testing.assert_array_equal(correction.sample(TIMES[5], np.ones(3)), expected)


def test_before_any_belief_and_after_clear_the_correction_is_none():
    correction = LiveCorrection(1.0)
    np.testing.assert_array_equal(correction.sample(0.0, np.array([3.0, 2.0, 1.0])), np.zeros(3))
    correction.believe(belief_of(100.0, [5.0, 0.0, 0.0]))
    correction.sample(100.5, np.zeros(3))
    correction.clear()
    np.testing.assert_array_equal(correction.sample(1.0, np.zeros(3)), np.zeros(3))


def test_points_are_placed_by_the_stretch_of_their_time():
    points, times = history_of((0.0, 2.0, 1.0, True), (2.5, 5.0, 3.0, True)).placed(cloud_at([1.0, 4.0]))
    np.testing.assert_allclose(points[:, 0], [1.0, 3.0])
    assert times.tolist() == [1.0, 4.0]


def test_between_two_times_the_correction_is_between_theirs():
    history = CorrectionHistory()
    poses = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    history.add(np.array([0.0, 2.0]), poses, Track(TIMES, still()(TIMES)), holds=True)
    assert history.placed(cloud_at([0.5]))[0][0, 0] == pytest.approx(0.5)


def test_points_of_a_rejected_stretch_have_no_place():
    points, times = history_of((0.0, 2.0, 1.0, True), (2.5, 5.0, 3.0, False)).placed(cloud_at([1.0, 3.0, 4.0]))
    assert (len(points), times.tolist()) == (1, [1.0])


def test_without_history_no_point_has_a_place():
    points, times = CorrectionHistory().placed(cloud_at([1.0, 4.0]))
    assert (len(points), len(times)) == (0, 0)
    assert CorrectionHistory().end == -np.inf


def test_only_the_last_stretches_are_kept():
    history = history_of(*[(float(k), k + 0.5, float(k), True) for k in range(9)])
    assert history.end == 8.5
    assert history.placed(cloud_at([0.2]))[0][0, 0] == pytest.approx(1.0)
