"""Many relative poses to one smooth run."""

import numpy as np
import pytest

from mlsm_manager.offline.pose_graph import RelativePoses, UnaryFactors, joined, smoothed
from node_support.geometry.planar import composed, inverse, rotated, wrapped

SIDE = 10
FREE = np.array([1e-6, 1e-6])


def square():
    """Return poses (41, 3) once around a square of 20 m, back to the start."""
    corners = np.repeat(np.arange(4), SIDE) * np.pi / 2.0
    steps = 2.0 * np.column_stack([np.cos(corners), np.sin(corners)])
    places = np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)])
    return np.column_stack([places, np.append(corners, 1.5 * np.pi)])


def relative(poses, first, second):
    found = composed(inverse(poses[first]), poses[second])
    found[:, 2] = wrapped(found[:, 2])
    return found


def edges(first, second, measured, deviation, by_odometry=False):
    information = np.tile(np.diag(np.asarray(deviation, dtype=float) ** -2), (len(first), 1, 1))
    return RelativePoses(
        np.asarray(first), np.asarray(second), np.asarray(measured), information, np.full(len(first), by_odometry)
    )


def odometry_of(truth, seed=0, deviation=(0.05, 0.05, 0.02)):
    first = np.arange(len(truth) - 1)
    noise = np.asarray(deviation) * np.random.default_rng(seed).normal(size=(len(first), 3))
    return edges(first, first + 1, relative(truth, first, first + 1) + noise, deviation, by_odometry=True)


def dead_reckoned(odometry):
    poses = [np.zeros(3)]
    for step in odometry.measured:
        poses.append(composed(poses[-1], step))
    return np.array(poses)


def nothing_known(count, motion=(1e6, 1e6)):
    return UnaryFactors(np.zeros(count), 0.0, np.array(motion))


def distance(poses, truth):
    return np.hypot(*(poses - truth)[:, :2].T)


def test_a_loop_takes_the_drift_away():
    truth = square()
    odometry = odometry_of(truth)
    start = dead_reckoned(odometry)
    loop = edges([0], [40], relative(truth, [0], [40]), (0.05, 0.05, 0.01))
    found = smoothed(start, joined([odometry, loop]), nothing_known(41))
    assert distance(start, truth)[-1] > 1.0
    assert distance(found.poses, truth)[-1] < 0.1
    assert distance(found.poses, truth).mean() < 0.5 * distance(start, truth).mean()


def test_a_wrong_loop_is_outvoted():
    truth = square()
    odometry = odometry_of(truth)
    pairs = np.arange(4), np.arange(37, 41)
    loops = edges(*pairs, relative(truth, *pairs), (0.05, 0.05, 0.01))
    wrong = edges([5], [25], [[3.0, -4.0, 0.5]], (0.05, 0.05, 0.01))
    start = dead_reckoned(odometry)
    without = smoothed(start, joined([odometry, loops]), nothing_known(41))
    found = smoothed(start, joined([odometry, loops, wrong]), nothing_known(41))
    assert distance(found.poses, without.poses).max() < 0.1


def test_scale_and_direction_of_the_odometry_come_out():
    truth = square()
    first = np.arange(40)
    measured = relative(truth, first, first + 1)
    measured[:, :2] = rotated(measured[:, :2], -0.07) / 1.03
    odometry = edges(first, first + 1, measured, (0.02, 0.02, 0.001), by_odometry=True)
    fixes = edges([0, 0, 0], [10, 20, 30], relative(truth, [0, 0, 0], [10, 20, 30]), (0.02, 0.02, 0.001))
    found = smoothed(dead_reckoned(odometry), joined([odometry, fixes]), nothing_known(41, FREE))
    assert found.motion == pytest.approx([0.03, 0.07], abs=2e-3)
    assert distance(found.poses, truth).max() < 0.05


def test_a_compass_holds_the_headings():
    truth = square()
    odometry = odometry_of(truth, deviation=(0.01, 0.01, 0.05))
    compass = UnaryFactors(truth[:, 2], 0.01**-2, np.array([1e6, 1e6]))
    found = smoothed(dead_reckoned(odometry), odometry, compass)
    assert np.abs(wrapped(found.poses[:, 2] - truth[:, 2])).max() < 0.02


def test_the_first_pose_stays():
    truth = square()
    odometry = odometry_of(truth)
    found = smoothed(dead_reckoned(odometry), odometry, nothing_known(41))
    np.testing.assert_allclose(found.poses[0], 0.0, atol=1e-6)
