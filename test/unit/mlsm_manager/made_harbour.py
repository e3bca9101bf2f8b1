"""A vehicle tours a walled harbour; its odometry errs in direction and its beams are late. The truth is known."""

from dataclasses import dataclass, replace
from typing import Callable, List, Optional, Sequence

import numpy as np
from made_recordings import HARBOUR, ranges_along

from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.scan_matching.scan import Scan, Track
from node_support.geometry import inverse, move_of, rotated, transformed

TURN = 14.0  # s per turn of the head
BEAMS = 120
SONAR_IN_BASE = np.array([0.3, 0.0])
# 300 m long and 20 m wide.
CANAL = np.array([[-25.0, -10.0], [275.0, -10.0], [275.0, 10.0], [-25.0, 10.0]])


@dataclass(frozen=True)
class Tour:
    """scans: as heard. truth, odometry: the vehicle's path."""

    scans: List[Scan]
    truth: Track
    odometry: Track


def tour(
    count: int, direction: float = 0.0, delay: float = 0.0, noise: float = 0.1, seed: int = 0,
    path: Optional[Callable[[np.ndarray], np.ndarray]] = None, corners: np.ndarray = HARBOUR,
) -> Tour:  # fmt: skip
    """Return a tour of `count` scans whose odometry goes `direction` [rad] beside the truth, with late beams.

    path: gives the true poses (m, 3) at times (m,); by default `weaving`.
    corners: (k, 2) m, of the walls around the water.
    """
    rng = np.random.RandomState(seed)
    times = np.arange(0.0, count * TURN + 5.0, 0.2)
    truth = Track(times, (path or weaving)(times))
    steps = rotated(np.diff(truth.poses[:, :2], axis=0), np.full(len(times) - 1, -direction))
    positions = np.vstack([np.zeros((1, 2)), np.cumsum(steps, axis=0)]) + truth.poses[0, :2]
    odometry = Track(times, np.column_stack([positions, truth.poses[:, 2]]))
    scans = [_scan(truth, odometry, number, delay, noise, rng, corners) for number in range(count)]
    return Tour(scans, truth, odometry)


def logged(scans: Sequence[Scan], sonar_in_base: np.ndarray = SONAR_IN_BASE, parts: int = 1) -> RunLog:
    """Return the log of a run with these scans, as the joint solver keeps it."""
    log = RunLog(sonar_in_base)
    log.take(scans, parts, 1.0)
    return log


def selected(scan: Scan, rows: np.ndarray) -> Scan:
    """Return a scan of some of its points."""
    return replace(scan, points=scan.points[rows], times=scan.times[rows], moving=scan.moving[rows])


def deaf(scans: Sequence[Scan], numbers: Sequence[int]) -> List[Scan]:
    """Return scans of which those with `numbers` heard nothing."""
    return [scan.without_points(scan.reference_time) if n in numbers else scan for n, scan in enumerate(scans)]


def that_heard(scan: Scan, truth: Track, places: np.ndarray) -> Scan:
    """Return a scan that heard `places` (n, 2) [m] instead, by a vehicle on the path `truth`."""
    points = scan.points.copy()
    points[:, :2] = transformed(scan.track.at(scan.times), transformed(inverse(truth.at(scan.times)), places))
    return replace(scan, points=points)


def placed_by(scan: Scan, track: Track) -> Scan:
    """Return a scan as it is when the odometry reports `track`."""
    moves = move_of(scan.track.at(scan.times), track.at(scan.times))
    return replace(scan, points=transformed(moves, scan.points), track=track)


def reporting(scan: Scan, factor: float) -> Scan:
    """Return a scan whose odometry reports distances that are `factor` times the true ones."""
    return placed_by(scan, scan.track.with_poses(scan.track.poses * [factor, factor, 1.0]))


def without_positions(scan: Scan) -> Scan:
    """Return a scan of a vehicle that reports its heading only."""
    return reporting(scan, 0.0)


def with_wild_odometry(scan: Scan) -> Scan:
    """Return a scan that leads to no solution."""
    poses = scan.track.poses.copy()
    poses[::2] = 1e200
    return replace(scan, track=scan.track.with_poses(poses))


def ahead(times: np.ndarray) -> np.ndarray:
    """Return the poses (m, 3) of a vehicle that keeps going ahead, along the path of the others."""
    poses = weaving(times)
    velocity = np.gradient(poses[:, :2], times, axis=0)
    return np.column_stack([poses[:, :2], np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))])


def weaving(times: np.ndarray) -> np.ndarray:
    """Return the poses (m, 3) of a vehicle that goes round and round without regard to its heading."""
    phase = times / 60.0
    return np.column_stack([12.0 * np.cos(phase), 7.0 * np.sin(2.0 * phase), 1.2 * np.sin(times / 13.0)])


def along_canal(times: np.ndarray) -> np.ndarray:
    """Return the poses (m, 3) of a vehicle that goes along the canal at 0.15 to 0.45 m/s and looks to both sides."""
    speed = 0.3 + 0.15 * np.sin(times / 70.0)
    x = np.cumsum(speed * np.gradient(times))
    yaw = 0.15 * np.sin(times / 9.0)
    return np.column_stack([x, np.cumsum(speed * np.sin(yaw) * np.gradient(times)), yaw])


def _scan(
    truth: Track, odometry: Track, number: int, delay: float, noise: float, rng: np.random.RandomState,
    corners: np.ndarray,
) -> Scan:  # fmt: skip
    stamps = number * TURN + TURN * (np.arange(BEAMS) + 1.0) / BEAMS
    bearings = 2.0 * np.pi * np.arange(BEAMS) / BEAMS
    poses = truth.at(stamps + delay)
    sonar = poses[:, :2] + rotated(np.tile(SONAR_IN_BASE, (BEAMS, 1)), poses[:, 2])
    ranges = ranges_along(sonar, bearings + poses[:, 2], corners) + rng.normal(0.0, noise, BEAMS)
    seen = SONAR_IN_BASE + ranges[:, np.newaxis] * np.column_stack([np.cos(bearings), np.sin(bearings)])
    points = np.column_stack([transformed(odometry.at(stamps), seen), np.zeros(BEAMS), np.full(BEAMS, 100.0)])
    return Scan(points, stamps, np.ones(BEAMS, dtype=bool), odometry, float(stamps[-1]))
