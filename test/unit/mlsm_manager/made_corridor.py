"""Scans of a harbour basin whose walls converge, heard by a wide beam from a vehicle that moves along it."""

import numpy as np

from mlsm_manager.scan_matching.scan import Scan, Track
from node_support.geometry import rotated

_WALLS = np.array(
    [[-20, 0], [-16, 6], [-9, 11], [50, -1], [90, -9], [120, -9], [123, -40], [80, -53], [10, -68]], dtype=float
)
_JETTIES = np.array([[-12, -2, -3, -29], [-18, -33, -4, -54], [-4, -54, 14, -53], [14, -53, 23, -86]], float)
_SEGMENTS = np.vstack([np.hstack([_WALLS[:-1], _WALLS[1:]]), _JETTIES])
_TURN_SECONDS = 13.8
_BEAMS = 200
_REACH = 50.0
_RANGE_NOISE = 0.15


def path(seconds=400.0):
    """Return a track along the basin, with turns to either side."""
    times = np.arange(0.0, seconds, 0.1)
    yaw = -0.25 + 0.5 * np.sin(times / 17.0)
    steps = 0.2 * 0.1 * np.column_stack([np.cos(yaw), np.sin(yaw)])
    return Track(times, np.column_stack([np.array([2.0, -5.0]) + np.cumsum(steps, axis=0), yaw]))


def heard(true, half_width=0.0, delay=0.0, range_scale=1.0, wander=0.0, direction=0.0, seed=0):
    """Return the scans of a vehicle on the track `true`.

    half_width: rad, to each side of the beam's axis. delay: s, by which the beams' stamps are early. range_scale: true
    ranges over those that are heard. wander: m/sqrt(s), random walk of the odometry. direction: rad, by which its ways
    are turned.
    """
    random = np.random.default_rng(seed)
    odometry = _erring(true, wander, direction, random)
    stamps = np.arange(true.times[0] + 1.0, true.times[-1] - 2.0, _TURN_SECONDS / _BEAMS)
    bearing = np.radians(360.0 / _BEAMS) * np.arange(len(stamps))
    ranges = np.full(len(stamps), np.inf)
    places = true.at(stamps + delay)
    for aside in np.linspace(-half_width, half_width, 9):
        ranges = np.minimum(ranges, _distance(places[:, :2], places[:, 2] + bearing + aside))
    echoed = (ranges < _REACH) & (random.random(len(stamps)) < 0.8)
    ranges = (ranges + _RANGE_NOISE * random.normal(size=len(stamps))) / range_scale
    turns = [np.arange(start, start + _BEAMS) for start in range(0, len(stamps) - _BEAMS, _BEAMS)]
    return [_scan(turn[echoed[turn]], stamps, bearing, ranges, odometry, stamps[turn[-1]]) for turn in turns]


def _scan(beams, stamps, bearing, ranges, odometry, end):
    origin = odometry.at(stamps[beams])
    arms = ranges[beams, np.newaxis] * np.column_stack([np.cos(bearing[beams]), np.sin(bearing[beams])])
    places = origin[:, :2] + rotated(arms, origin[:, 2])
    points = np.column_stack([places, np.zeros(len(beams)), np.full(len(beams), 127.0)])
    return Scan(points, stamps[beams], np.ones(len(beams), dtype=bool), odometry, end)


def _erring(true, wander, direction, random):
    steps = wander * np.sqrt(np.diff(true.times))[:, np.newaxis] * random.normal(size=(len(true.times) - 1, 2))
    poses = true.poses.copy()
    steps += rotated(np.diff(true.poses[:, :2], axis=0), direction)
    poses[1:, :2] = poses[0, :2] + np.cumsum(steps, axis=0)
    return Track(true.times, poses)


def _distance(origin, angle):
    ray = np.column_stack([np.cos(angle), np.sin(angle)])[:, np.newaxis]
    start, along = _SEGMENTS[:, :2], _SEGMENTS[:, 2:] - _SEGMENTS[:, :2]
    offset = start - origin[:, np.newaxis]
    area = ray[..., 0] * along[:, 1] - ray[..., 1] * along[:, 0]
    distance = (offset[..., 0] * along[:, 1] - offset[..., 1] * along[:, 0]) / area
    share = (offset[..., 0] * ray[..., 1] - offset[..., 1] * ray[..., 0]) / area
    return np.where((distance > 0.5) & (share >= 0.0) & (share <= 1.0), distance, np.inf).min(axis=1)
