"""Recordings whose odometry counts z down are noticed."""

import numpy as np
import pytest

from mlsm_manager.matching.problem.scan import Scan, Track
from mlsm_manager.self_check.north_east_down import ZDownSigns, suspicions
from node_support.geometry.planar import transformed

TURN = 0.4
LEVEL = np.zeros(10)


def _scans(count, told_turn):
    """Return scans of a room of 20 x 12 m by a vehicle that turns by TURN from scan to scan and tells `told_turn`."""
    rng = np.random.default_rng(0)
    corners = np.array([[10.0, 6.0], [-10.0, 6.0], [-10.0, -6.0], [10.0, -6.0], [10.0, 6.0]])
    share = np.linspace(0.0, 1.0, 80, endpoint=False)[:, np.newaxis]
    walls = np.concatenate([a + share * (b - a) for a, b in zip(corners, corners[1:])]) + np.array([4.0, 1.0])
    scans = []
    for number in range(count):
        seen = transformed(np.array([0.0, 0.0, -TURN * number]), walls) + rng.normal(0.0, 0.05, walls.shape)
        pose = np.array([0.0, 0.0, told_turn * number])
        track = Track(np.array([number, number + 1.0]), np.array([pose, pose]))
        points = np.column_stack([transformed(pose, seen), np.zeros(len(seen)), np.full(len(seen), 100.0)])
        scans.append(Scan(points, np.full(len(points), number + 0.5), np.ones(len(points), bool), track, number + 1.0))
    return scans


def test_a_yaw_that_the_echoes_follow_is_no_suspicion():
    assert suspicions(LEVEL, _scans(8, TURN)) == []


def test_a_yaw_against_the_drift_of_the_echoes_is_one():
    (sign,) = suspicions(LEVEL, _scans(8, -TURN))
    assert sign == "in 100 % of the turns the echoes drift with the yaw instead of against it"


def test_a_few_turns_are_not_enough_to_say():
    assert suspicions(LEVEL, _scans(4, -TURN)) == []


@pytest.mark.parametrize(("heights", "count"), [([0.0, 3.0, 5.0], 1), ([0.0, -3.0, -5.0], 0), ([-5.0, 0.0, -5.0], 1)])
def test_a_vehicle_that_climbs_far_above_its_start_is_a_suspicion(heights, count):
    assert len(suspicions(np.array(heights), [])) == count


@pytest.mark.parametrize(("heights", "count"), [([-5.0, 0.0], 0), ([-5.0, 1.5], 0), ([0.0, 2.5], 1), ([3.0, 4.0], 1)])
def test_a_live_vehicle_is_compared_with_the_surface(heights, count):
    signs = ZDownSigns()
    for height in heights:
        signs.take_heights(np.array([height]))
    assert len(signs.lines()) == count


def test_a_live_vehicle_is_suspected_once_enough_turns_speak_against_it():
    signs = ZDownSigns()
    known = []
    for scan in _scans(8, -TURN):
        signs.take_scan(scan)
        known.append(len(signs.lines()))
    assert known == [0, 0, 0, 0, 0, 1, 1, 1]
