"""Scans of a small harbour without noise: what a vehicle on a known path hears, placed by an odometry that may err."""

from dataclasses import replace

import numpy as np
from made_maps import map_with

from mlsm_manager.scan_matching.scan import Belief, Scan, Track
from node_support.geometry import composed, move_of, transformed

SECONDS = 16.0
DEVIATIONS = np.array([1.0, 1.0, 0.1, 1e-2, 1e-2, 1e-3, 1e-3, 1e-3])


def wall(start, end, spacing=0.4, offset=0.0):
    """Return points (n, 2) along a wall, `spacing` m apart, the first one `offset` m from its start."""
    start, end = np.array(start, dtype=float), np.array(end, dtype=float)
    length = np.linalg.norm(end - start)
    return start + np.arange(offset, length, spacing)[:, np.newaxis] * (end - start) / length


def harbour(offset=0.0):
    """Return points (n, 2): two walls that meet, a jetty, and three posts."""
    posts = np.array([[3.0, 8.0], [-6.0, 4.0], [7.0, -3.0]])
    around = 0.15 * np.column_stack([np.cos(np.arange(6.0)), np.sin(np.arange(6.0))])
    walls = [wall((-12, 12), (14, 12), offset=offset), wall((14, 12), (14, -10), offset=offset)]
    jetty = wall((-10, -8), (-4, -10), offset=offset)
    return np.vstack([*walls, jetty, (posts[:, np.newaxis] + around).reshape(-1, 2)])


def at_velocity(velocity, start=(0.0, 0.0, 0.0)):
    """Return the path of constant body `velocity` (3,) from `start` (3,) at time 0: times (n,) to poses (n, 3)."""
    x_rate, y_rate, turn_rate = velocity

    def poses(times):
        seconds = np.maximum(np.asarray(times, dtype=float), 0.0)
        yaw = turn_rate * seconds
        if turn_rate == 0.0:
            along, aside = seconds, np.zeros_like(seconds)
        else:
            along, aside = np.sin(yaw) / turn_rate, (1.0 - np.cos(yaw)) / turn_rate
        moved = np.stack([x_rate * along - y_rate * aside, x_rate * aside + y_rate * along, yaw], axis=-1)
        return composed(np.array(start), moved)

    return poses


def still(pose=(0.0, 0.0, 0.0)):
    """Return the path of a vehicle that stays at `pose`."""
    return at_velocity((0.0, 0.0, 0.0), pose)


def scan_of(places, true_path, odometry=None, start=0.0, moving=False):
    """Return the scan that hears `places` (n, 2) in the order of their bearing, one turn from time `start` on."""
    odometry = odometry or true_path
    bearing = np.arctan2(*(places - true_path(start)[:2]).T[::-1])
    places = places[np.argsort(bearing)]
    times = start + np.linspace(0.0, SECONDS, len(places))
    to_odometry = move_of(true_path(times), odometry(times))
    points = np.column_stack([places, np.full(len(places), -2.0), np.full(len(places), 50.0)])
    track_times = np.linspace(start - SECONDS, start + SECONDS, 129)
    track = Track(track_times, odometry(track_times))
    return Scan(transformed(to_odometry, points), times, np.full(len(times), moving), track, start + SECONDS)


def drifting(turn, places=None):
    """Return a scan of a vehicle at rest while its odometry drifts by 0.32 and 0.16 m a turn after the first."""

    def drift(times):
        return at_velocity((0.02, 0.01, 0.0))(np.asarray(times) - SECONDS)

    return scan_of(harbour() if places is None else places, still(), drift, start=SECONDS * turn)


def elsewhere(turn):
    """Return such a scan of a place that is in no map."""
    return drifting(turn, np.random.RandomState(turn).uniform(-20.0, 20.0, (100, 2)))


def later(scan, seconds):
    """Return a scan as it would have come so many seconds later."""
    track = Track(scan.track.times + seconds, scan.track.poses)
    return replace(scan, times=scan.times + seconds, reference_time=scan.reference_time + seconds, track=track)


def map_of(places, resolution=0.5):
    """Return the blocks of a map of `places` (n, 2)."""
    points = np.column_stack([places, np.full(len(places), -2.0), np.full(len(places), 50.0)])
    return map_with(points, resolution).blocks


def belief_in(pose, scan, deviations=DEVIATIONS):
    """Return the belief in `pose` (3,) at the end of a scan and in the odometry's motion."""
    return Belief(scan.reference_time, np.append(pose, np.zeros(5)), np.diag(np.array(deviations) ** 2))
