"""A vehicle that drives and turns in a square basin: its turns, freed of that motion, lie on the walls."""

import math

import numpy as np
import pytest
from clouds import beam_of

from node_support.geometry import pose_matrix
from sonar_processing.beams.beam import PlacedBeam
from sonar_processing.ros.conversions import laser_scan_message, point_cloud
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
        beam = beam_of(strengths, angle, BIN, seconds=1000)
        pose = pose_matrix((x, y, -2.0), (0.0, 0.0, yaw))
        beams.append(PlacedBeam(_at(beam, seconds), pose, is_moving=True))
    return PolarScan.of(beams)


def _at(beam, seconds):
    return type(beam)(beam.stamp_ns + round(seconds * 1e9), beam.frame_id, beam.angle, beam.intensities, BIN)


def _off_the_walls(turn, x, y):
    """Return how far points (n,) of the newest sonar pose are from the nearest wall, m."""
    places = (turn.T_target_sonar[-1] @ np.array([x, y, np.zeros_like(x), np.ones_like(x)]))[:2]
    return np.abs(np.abs(places).max(axis=0) - HALF_SIDE)


def _projected(message):
    ranges = np.asarray(message.ranges, dtype=np.float64)
    heard = np.flatnonzero(np.isfinite(ranges))
    angles = message.angle_min + heard * message.angle_increment
    return ranges[heard] * np.cos(angles), ranges[heard] * np.sin(angles)


def _message(turn, **values):
    parameters = SonarToCloudParameters(laser_strongest_above=50.0, **values)
    return laser_scan_message(planar_laser_scan(turn, parameters), turn.stamp_ns, turn.sonar_frame)


def test_the_laser_scan_lies_on_the_walls_within_a_bin(turn):
    x, y = _projected(_message(turn, laser_scan_rays=3600))
    assert x.size == RAYS
    assert _off_the_walls(turn, x, y).max() < BIN


def test_a_ray_per_step_of_the_head_is_off_by_half_a_step_at_most(turn):
    x, y = _projected(_message(turn))
    assert x.size > 0.85 * RAYS
    assert (_off_the_walls(turn, x, y) < BIN + np.hypot(x, y) * STEP / 2.0).all()


def test_a_turn_that_is_not_freed_of_the_motion_is_far_off_the_walls(turn):
    angles = turn.angles
    ranges = turn.ranges[turn.strengths.argmax(axis=1)]
    assert _off_the_walls(turn, ranges * np.cos(angles), ranges * np.sin(angles)).max() > 1.0


def test_the_laser_scan_is_honest(turn):
    message = _message(turn)
    assert message.header.stamp.to_nsec() == turn.stamp_ns
    assert (message.time_increment, message.angle_increment > 0.0) == (0.0, True)
    assert message.scan_time == pytest.approx(SECONDS, abs=0.1)
    ranges = np.asarray(message.ranges)
    assert ((ranges <= message.range_max) | np.isinf(ranges)).all()


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


def test_the_message_of_the_cloud_names_its_fields(turn):
    points = turn_cloud(turn, SonarToCloudParameters())
    message = point_cloud(points, turn.stamp_ns, turn.sonar_frame, fields=TURN_FIELDS)
    assert [field.name for field in message.fields] == list(TURN_FIELDS)
    assert (message.point_step, message.width) == (20, len(points))
