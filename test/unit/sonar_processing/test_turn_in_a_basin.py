"""A vehicle that drives and turns in a square basin: its turns, freed of that motion, lie on the walls."""

import math

import numpy as np
import pytest

from node_support.geometry import pose_matrix
from sonar_processing.beams.beam import Beam, PlacedBeam
from sonar_processing.ros.conversions import laser_scan_message
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.polar_scan import TURN_FIELDS, PolarScan, planar_laser_scan, turn_cloud

HALF_SIDE, RAYS, BINS, BIN = 10.0, 200, 300, 0.1
SECONDS, SPEED, TURN_RATE = 16, 0.3, 0.03
STEP = 2.0 * math.pi / RAYS


def _distance(x, y, heading):
    """Return the distance to the wall of the basin along a heading."""
    along_x = (math.copysign(HALF_SIDE, math.cos(heading)) - x) / math.cos(heading)
    along_y = (math.copysign(HALF_SIDE, math.sin(heading)) - y) / math.sin(heading)
    return min(along_x, along_y)


@pytest.fixture(scope="module", params=[1, -1], ids=["counter-clockwise", "clockwise"])
def turn(request):
    beams = []
    for number in range(RAYS):
        seconds = SECONDS * number / RAYS
        x, y, yaw = -4.0 + SPEED * seconds, 2.0 - 0.1 * seconds, 0.4 + TURN_RATE * seconds
        angle = request.param * (number + 0.5) * STEP
        strengths = np.full(BINS, 3, np.uint8)
        strengths[int(_distance(x, y, yaw + angle) / BIN)] = 120
        beam = Beam(round((1000 + seconds) * 1e9), "sonar", angle, strengths, BIN)
        beams.append(PlacedBeam(beam, pose_matrix((x, y, -2.0), (0.0, 0.0, yaw)), is_moving=True))
    return PolarScan.of(beams)


def _off_the_walls(turn, x, y):
    """Return how far points (n,) of the newest sonar pose are from the nearest wall, m."""
    places = (turn.T_target_sonar[-1] @ np.array([x, y, np.zeros_like(x), np.ones_like(x)]))[:2]
    return np.abs(np.abs(places).max(axis=0) - HALF_SIDE)


def _laser_points(turn, **values):
    """Return x and y of the echoes of a laser scan, as a reader of its message places them."""
    scan = planar_laser_scan(turn, SonarToCloudParameters(laser_strongest_above=50.0, **values))
    message = laser_scan_message(scan, turn.stamp_ns, turn.sonar_frame)
    ranges = np.asarray(message.ranges, dtype=np.float64)
    heard = np.flatnonzero(np.isfinite(ranges))
    angles = message.angle_min + heard * message.angle_increment
    return ranges[heard] * np.cos(angles), ranges[heard] * np.sin(angles)


def test_the_laser_scan_lies_on_the_walls_within_a_bin(turn):
    x, y = _laser_points(turn, laser_scan_rays=3600)
    assert x.size == RAYS
    assert _off_the_walls(turn, x, y).max() < BIN


def test_a_ray_per_step_of_the_head_is_off_by_half_a_step_at_most(turn):
    x, y = _laser_points(turn)
    assert x.size > 0.85 * RAYS
    assert (_off_the_walls(turn, x, y) < BIN + np.hypot(x, y) * STEP / 2.0).all()


def test_a_turn_that_is_not_freed_of_the_motion_is_far_off_the_walls(turn):
    ranges = turn.ranges[turn.strengths.argmax(axis=1)]
    assert _off_the_walls(turn, ranges * np.cos(turn.angles), ranges * np.sin(turn.angles)).max() > 1.0


def test_the_cloud_lies_on_the_walls_within_a_bin_and_tells_when(turn):
    points = turn_cloud(turn, SonarToCloudParameters(min_range=0.0))
    assert points.shape == (RAYS * BINS, len(TURN_FIELDS))
    walls = points[points[:, 3] == 120]
    assert _off_the_walls(turn, walls[:, 0].astype(float), walls[:, 1].astype(float)).max() < BIN
    times = points[:, 4]
    assert (times.max(), times.min()) == (0.0, pytest.approx(-SECONDS * (RAYS - 1) / RAYS))
    assert (np.diff(times) >= 0.0).all()


def test_the_cloud_leaves_out_what_min_range_removes(turn):
    points = turn_cloud(turn, SonarToCloudParameters(min_range=1.0))
    assert len(points) == RAYS * (BINS - 10)
