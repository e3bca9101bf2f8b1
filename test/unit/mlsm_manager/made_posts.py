"""Scans of a straight canal with posts in it, heard by a vehicle that goes along it and knows its heading only."""

from dataclasses import replace

import numpy as np

from mlsm_manager.scan_matching.scan import Scan, Track

SPEED = 0.3  # m/s along +x
POSTS = np.array([[5.0, 4.0], [17.0, -6.0], [30.0, 5.0], [41.0, -4.0], [55.0, 6.0], [70.0, -5.0], [82.0, 3.0]])
_HALF_WIDTH = 10.0  # m
_REACH = 30.0  # m
_BEAMS, _TURN_SECONDS = 120, 12.0
_STRENGTH = 100.0
_NOISE = 0.05  # m


def true_path(times):
    """Return where the vehicle is at `times` (n,) [s]: (n, 2) m."""
    return np.column_stack([SPEED * np.asarray(times), np.zeros(len(times))])


def heard(turns, posts=POSTS, seed=0):
    """Return the scans of `turns` turns of the head."""
    times = np.arange(0.0, turns * _TURN_SECONDS + 5.0, 0.5)
    track = Track(times, np.zeros((len(times), 3)))
    rng = np.random.RandomState(seed)
    return [_scan(turn * _TURN_SECONDS, track, posts, rng) for turn in range(turns)]


def cluttered(scans):
    """Yield the scans with ten strong echoes more each, anywhere in 50 x 26 m around the vehicle."""
    rng = np.random.RandomState(0)
    for scan in scans:
        places = rng.uniform([-25.0, -13.0], [25.0, 13.0], (10, 2))
        points = np.vstack([scan.points, np.column_stack([places, np.zeros(10), np.full(10, _STRENGTH)])])
        times = np.append(scan.times, rng.uniform(scan.times[0], scan.times[-1], 10))
        order = np.argsort(times, kind="stable")
        yield replace(scan, points=points[order], times=times[order], moving=np.ones(len(times), dtype=bool))


def _scan(start, track, posts, rng):
    stamps = start + _TURN_SECONDS / _BEAMS * np.arange(_BEAMS)
    bearings = 2.0 * np.pi / _BEAMS * np.arange(_BEAMS)
    places = true_path(stamps)
    echoes = [_heard(stamp, bearing, place, posts) for stamp, bearing, place in zip(stamps, bearings, places)]
    rows = np.array([(*echo, time) for echo, time in zip(echoes, stamps) if echo is not None])
    points = np.zeros((len(rows), 4))
    points[:, :2] = rows[:, :2] * (1.0 + _NOISE * rng.normal(size=(len(rows), 1)) / np.hypot(*rows[:, :2].T)[:, None])
    points[:, 3] = _STRENGTH
    return Scan(points, rows[:, 2], np.ones(len(rows), dtype=bool), track, stamps[-1])


def _heard(stamp, bearing, place, posts):
    """Return what one beam hears first, (2,) m from the vehicle: a post within it, or a wall."""
    sight = np.array([np.cos(bearing), np.sin(bearing)])
    seen = posts - place
    ranges = np.hypot(*seen.T)
    aside = np.abs(np.angle(np.exp(1j * (np.arctan2(seen[:, 1], seen[:, 0]) - bearing))))
    wall = _HALF_WIDTH / max(abs(sight[1]), 1e-6)
    near = ranges[aside < np.pi / _BEAMS]
    first = min([wall, *near])
    return first * sight if first < _REACH else None
