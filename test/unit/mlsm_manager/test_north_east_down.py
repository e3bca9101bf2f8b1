"""Recordings whose odometry counts z down are noticed."""

import numpy as np
import pytest
from map_bag_runs import BASIN

from mlsm_manager.offline.recording import read_recording, scans_of
from mlsm_manager.offline.replay_parameters import ReplayParameters
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.self_check.north_east_down import ZDownSigns, z_down_signs
from node_support.geometry import inverse, transformed
from recordings.motion.vehicle_motion import MotionNames
from recordings.reader import Request

TURN = 0.4
LEVEL = np.zeros(10)
TURNED_OVER = -1.0


def _scans(count, sign=1.0, turn=TURN, step=(0.0, 0.0)):
    """Return scans of a room of 20 x 12 m by a vehicle that turns and moves from scan to scan.

    sign: 1.0, or TURNED_OVER for an odometry that counts z down.
    """
    rng = np.random.default_rng(0)
    corners = np.array([[10.0, 6.0], [-10.0, 6.0], [-10.0, -6.0], [10.0, -6.0], [10.0, 6.0]])
    share = np.linspace(0.0, 1.0, 80, endpoint=False)[:, np.newaxis]
    walls = np.concatenate([a + share * (b - a) for a, b in zip(corners, corners[1:])]) + np.array([4.0, 1.0])
    scans = []
    for number in range(count):
        pose = number * np.array([*step, turn])
        told = pose * np.array([1.0, sign, sign])
        seen = transformed(inverse(pose), walls) + rng.normal(0.0, 0.05, walls.shape)
        track = Track(np.array([number, number + 1.0]), np.array([told, told]))
        points = np.column_stack([transformed(told, seen), np.zeros(len(seen)), np.full(len(seen), 100.0)])
        scans.append(Scan(points, np.full(len(points), number + 0.5), np.ones(len(points), bool), track, number + 1.0))
    return scans


def test_a_yaw_that_the_echoes_follow_is_no_suspicion():
    assert z_down_signs(LEVEL, _scans(8)).lines() == []


def test_a_yaw_that_turns_against_the_echoes_is_one():
    (sign,) = z_down_signs(LEVEL, _scans(8, TURNED_OVER)).lines()
    assert sign == "in 100 % of the scans the echoes fit better with y and yaw reversed"


def test_a_vehicle_that_drives_its_turns_tells_it_as_well():
    assert z_down_signs(LEVEL, _scans(8, step=(0.5, 0.3))).lines() == []
    assert len(z_down_signs(LEVEL, _scans(8, TURNED_OVER, step=(0.5, 0.3))).lines()) == 1


def test_a_vehicle_that_stands_tells_nothing():
    signs = ZDownSigns()
    for scan in _scans(8, TURNED_OVER, turn=0.0):
        signs.take_scan(scan)
    assert signs.lines() == []


@pytest.mark.parametrize(("heights", "count"), [([0.0, 3.0, 5.0], 1), ([0.0, -3.0, -5.0], 0), ([-5.0, 0.0, -5.0], 1)])
def test_a_vehicle_that_climbs_far_above_its_start_is_a_suspicion(heights, count):
    assert len(z_down_signs(np.array(heights), []).lines()) == count


@pytest.mark.parametrize(("heights", "count"), [([-5.0, 0.0], 0), ([-5.0, 1.5], 0), ([0.0, 2.5], 1), ([3.0, 4.0], 1)])
def test_a_live_vehicle_is_compared_with_the_surface(heights, count):
    signs = ZDownSigns()
    for height in heights:
        signs.take_heights(np.array([height]))
    assert len(signs.lines()) == count


def test_a_live_vehicle_is_suspected_once_enough_turns_speak_against_it():
    signs = ZDownSigns()
    known = []
    for scan in _scans(8, TURNED_OVER):
        signs.take_scan(scan)
        known.append(len(signs.lines()))
    assert known == [0, 0, 0, 0, 0, 1, 1, 1]


@pytest.mark.parametrize(("z_is_down", "count"), [(False, 0), (True, 1)])
def test_a_tour_of_the_basin_turned_over_is_suspected(z_is_down, count):
    recording = read_recording(BASIN, Request(motion=MotionNames(z_is_down=z_is_down)))
    scans = [scan for scan, _ in scans_of(recording, ReplayParameters().echoes())]
    assert len(z_down_signs(LEVEL, scans).lines()) == count


def test_a_run_whose_turns_are_reversed_is_doubted():
    assert not z_down_signs(LEVEL, _scans(8)).turns().fires
    assert z_down_signs(LEVEL, _scans(8, TURNED_OVER)).turns().fires
    assert "too little" in z_down_signs(LEVEL, _scans(4, TURNED_OVER)).turns().line()
