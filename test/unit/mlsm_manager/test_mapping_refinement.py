"""Keyframes, their edges, and a run smoothed afterwards."""

import numpy as np
import pytest
from made_corridor import heard, path

from mlsm_manager.matching.problem.prediction import OdometryErrors, advanced, advanced_path
from mlsm_manager.matching.problem.result import MatchResult, MatchStatus
from mlsm_manager.matching.problem.scan import Track
from mlsm_manager.offline.keyframes import keyframes_of, path_through
from mlsm_manager.offline.loops import measured_alone, partners
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.refinement import odometry_edges, refine
from mlsm_manager.offline.replay import replay
from mlsm_manager.offline.replay_parameters import ReplayParameters

TIMES = np.linspace(0.0, 40.0, 401)
STRAIGHT = Track(TIMES, np.column_stack([0.5 * TIMES, np.zeros((401, 2))]))


@pytest.fixture(scope="module")
def replayed():
    scans = heard(path(250.0), wander=0.05, direction=0.08)
    recording = Recording([], 0, scans[0].track, None)
    return recording, replay(recording, scans, ReplayParameters(), lambda done: None)


def test_the_path_goes_through_the_keyframes():
    times, poses = np.array([10.0, 30.0]), np.array([[5.0, 1.0, 0.1], [15.0, 3.0, 0.1]])
    found = Track(TIMES, path_through(poses, times, np.zeros(2), STRAIGHT))
    np.testing.assert_allclose(found.at(times), poses, atol=1e-9)


def test_between_keyframes_what_is_left_is_spread_over_the_time():
    found = path_through(np.array([[0.0, 0.0, 0.0], [20.0, 4.0, 0.0]]), np.array([0.0, 40.0]), np.zeros(2), STRAIGHT)
    np.testing.assert_allclose(found[200], [10.0, 2.0, 0.0], atol=1e-9)


def test_before_and_after_the_keyframes_the_odometry_goes_on():
    found = path_through(np.array([[5.0, 1.0, 0.0], [15.0, 1.0, 0.0]]), np.array([10.0, 30.0]), np.zeros(2), STRAIGHT)
    np.testing.assert_allclose(found[[0, -1], :2], [[0.0, 1.0], [20.0, 1.0]], atol=1e-9)


def test_a_keyframe_is_matched_with_some_before_it_and_with_earlier_ones_of_its_place():
    out, back = np.arange(30.0), np.arange(29.0, -1.0, -1.0)
    poses = np.column_stack([np.append(out, back) * 5.0, np.zeros((60, 2))])
    assert partners(poses, 0) == []
    assert partners(poses, 1) == [0]
    assert partners(poses, 10) == [8, 5]
    assert partners(poses, 59) == [57, 54, 0, 4]


def test_points_alone_are_what_is_left_of_a_fit_without_its_prior():
    prior, points = np.diag([4.0, 4.0, 100.0]), np.diag([12.0, 0.0, 300.0])
    covariance = np.eye(8)
    covariance[:3, :3] = np.linalg.inv(prior + points)
    measured, expected = np.array([2.0, 0.0, 0.04]), np.array([1.0, 0.0, 0.0])
    mean = np.linalg.solve(prior + points, points @ measured + prior @ expected)
    result = MatchResult(
        MatchStatus.CONVERGED, mean, np.zeros(3), np.eye(6), np.zeros(3), np.zeros(2), covariance, 0.1, 50, 5, 0.01,
        np.array([0.0]), mean[np.newaxis],
    )  # fmt: skip
    pose, information = measured_alone(result, expected, np.linalg.inv(prior))
    assert pose == pytest.approx([2.0, 0.0, 0.04])
    np.testing.assert_allclose(information, points, atol=1e-6)


def test_keyframes_are_the_scans_in_the_map(replayed):
    _, run = replayed
    keyframes = keyframes_of(run.updates)
    assert len(keyframes) == sum(update.accepted for update in run.updates)
    assert (np.diff([keyframe.time for keyframe in keyframes]) > 0.0).all()


def test_a_smoothed_run_is_nearer_to_the_truth_than_its_odometry(replayed):
    recording, run = replayed
    found = refine(recording, run, run.mapper.matcher, lambda done: None)
    assert _error(found.poses, run) < 0.6 * _error(run.odometry, run)
    assert found.edges > 30
    assert len(found.blocks) > 100


def _error(poses, run):
    """Return the mean distance from the true way since the first scan, which the map begins with."""
    error = (poses - path(250.0).poses)[:, :2]
    first = np.searchsorted(run.times, run.updates[0].scan.reference_time)
    return np.hypot(*(error - error[first])[first:].T).mean()


def test_what_is_corrected_at_a_moment_does_not_hang_on_what_came_later(replayed):
    recording, run = replayed
    scans = heard(path(250.0), wander=0.05, direction=0.08)
    shorter = replay(recording, scans[:8], ReplayParameters(), lambda done: None)
    until = scans[7].reference_time
    known = recording.track.times < until
    np.testing.assert_allclose(shorter.corrected[known], run.corrected[known], atol=1e-9)


def test_edges_of_the_odometry_are_less_certain_the_longer_they_last():
    edges = odometry_edges(np.array([0.0, 10.0, 30.0]), STRAIGHT, OdometryErrors())
    assert edges.information[0, 0, 0] > edges.information[1, 0, 0]
    np.testing.assert_allclose(edges.measured[:, 0], [5.0, 10.0])


def test_a_step_of_the_odometry_in_plain_numbers_is_that_of_the_path():
    random = np.random.default_rng(3)
    theta, before, after = random.normal(size=8), random.normal(size=3), random.normal(size=3)
    track = Track(np.array([0.0, 0.1]), np.array([before, after]))
    expected = advanced_path(theta, 0.0, track, np.array([0.1]))[-1]
    np.testing.assert_allclose(advanced(theta, 0.1, before, after), expected)


def test_errors_of_the_speed_wander_like_a_random_walk_in_the_long_run():
    errors = OdometryErrors(speed_deviation=0.1, rate_time=5.0)
    assert errors.wandering(0.01) == pytest.approx((0.1 * 0.01) ** 2, rel=0.01)
    assert errors.wandering(5000.0) == pytest.approx(2.0 * 0.1**2 * 5.0 * 5000.0, rel=0.01)
