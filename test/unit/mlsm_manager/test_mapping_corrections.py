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


def belief_of(time, pose, speed_error=0.0):
    return Belief(time, np.concatenate([pose, [speed_error], np.zeros(4)]), np.zeros((8, 8)))


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


def shown(correction, times=TIMES):
    """Return the corrections (n, 3) that are shown at `times` while the odometry stands at zero."""
    return np.array([correction.sample(time, np.zeros(3)) for time in times])


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0))
def test_after_the_blend_the_pose_is_the_believed_one(x, y, yaw):
    correction = LiveCorrection(1.0)
    correction.sample(0.0, np.zeros(3))
    correction.believe(belief_of(0.0, [x, y, yaw]))
    np.testing.assert_allclose(shown(correction, [0.1, 0.6, 1.2])[-1], [x, y, yaw], atol=1e-9)


def test_a_new_fix_is_approached_without_a_jump():
    correction = LiveCorrection(1.0)
    correction.believe(belief_of(0.0, np.zeros(3)))
    before = shown(correction, TIMES[:50])
    correction.believe(belief_of(TIMES[49], [1.0, 0.0, 0.0]))
    x = np.concatenate([before, shown(correction, TIMES[50:])])[:, 0]
    assert np.abs(np.diff(x)).max() < 0.11
    assert x[-1] == pytest.approx(1.0)


@pytest.mark.parametrize("sampled_at", [TIMES[:50], [0.0, 1.9], [0.0, 1.5], [0.0]], ids=len)
def test_a_fix_is_advanced_from_its_own_time_on_by_the_odometry_and_its_errors(sampled_at):
    """The fix is of 2 s; the first odometry after it may be of 2.3 s."""
    odometry = at_velocity((0.5, 0.0, 0.0))
    correction = LiveCorrection(0.0)
    for time in sampled_at:
        correction.sample(time, odometry(time))
    correction.believe(belief_of(2.0, odometry(2.0) + np.array([0.0, 3.0, 0.0]), 0.2))
    now = max(sampled_at[-1], 2.2) + 0.1
    np.testing.assert_allclose(correction.sample(now, odometry(now)), [0.2 * (now - 2.0), 3.0, 0.0], atol=1e-9)


def test_an_error_of_the_speed_that_was_found_goes_on():
    correction = LiveCorrection(0.0)
    correction.believe(belief_of(0.0, np.zeros(3), 0.2))
    np.testing.assert_allclose(shown(correction)[:, 0], 0.2 * TIMES, atol=1e-9)


def with_fading(time, pose, speed, usual):
    belief = belief_of(time, pose, speed)
    return replace(belief, fading=Fading(np.array([usual, 0.0, 0.0]), np.full(3, 20.0)))


def test_a_speed_that_fades_goes_on_as_it_is_expected():
    """From 0.4 towards 0.1 m/s within 20 s, and not along with what the odometry says."""
    correction, times = LiveCorrection(0.0), np.arange(0.0, 14.0, 0.1)
    correction.believe(with_fading(0.0, np.zeros(3), 0.4, 0.1))
    expected = 0.1 * times + 0.3 * 20.0 * (1.0 - np.exp(-times / 20.0))
    np.testing.assert_allclose(shown(correction, times)[:, 0], expected, atol=1e-4)


def test_a_fix_of_the_past_is_brought_to_now_as_its_speed_fades():
    at_once, later = LiveCorrection(0.0), LiveCorrection(0.0)
    belief = with_fading(2.0, np.array([1.0, 2.0, 0.5]), 0.4, 0.1)
    at_once.believe(belief)
    shown(later, TIMES[:-1])
    later.believe(belief)
    np.testing.assert_allclose(shown(later, TIMES[-1:])[-1], shown(at_once, TIMES[20:])[-1], atol=1e-9)


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
    expected = shown(correction, TIMES[:20])[-1]
    np.testing.assert_array_equal(correction.sample(TIMES[5], np.ones(3)), expected)


def test_before_any_belief_and_after_clear_the_correction_is_none():
    correction = LiveCorrection(1.0)
    np.testing.assert_array_equal(correction.sample(0.0, np.array([3.0, 2.0, 1.0])), np.zeros(3))
    correction.believe(belief_of(100.0, [5.0, 0.0, 0.0]))
    correction.sample(100.5, np.zeros(3))
    correction.clear()
    np.testing.assert_array_equal(correction.sample(1.0, np.zeros(3)), np.zeros(3))


@pytest.mark.parametrize(("holds", "placed"), [(True, [(1.0, 1.0), (4.0, 3.0)]), (False, [(1.0, 1.0)])])
def test_points_are_placed_by_the_stretch_of_their_time_unless_that_was_rejected(holds, placed):
    points, times = history_of((0.0, 2.0, 1.0, True), (2.5, 5.0, 3.0, holds)).placed(cloud_at([1.0, 4.0]))
    np.testing.assert_allclose(np.column_stack([times, points[:, 0]]), placed)


def test_between_two_times_the_correction_is_between_theirs():
    history = CorrectionHistory()
    poses = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    history.add(np.array([0.0, 2.0]), poses, Track(TIMES, still()(TIMES)), holds=True)
    assert history.placed(cloud_at([0.5]))[0][0, 0] == pytest.approx(0.5)


def test_without_history_no_point_has_a_place():
    points, times = CorrectionHistory().placed(cloud_at([1.0, 4.0]))
    assert (len(points), len(times)) == (0, 0)
    assert CorrectionHistory().end == -np.inf


def test_only_the_last_stretches_are_kept():
    history = history_of(*[(float(k), k + 0.5, float(k), True) for k in range(9)])
    assert history.end == 8.5
    assert history.placed(cloud_at([0.2]))[0][0, 0] == pytest.approx(1.0)
