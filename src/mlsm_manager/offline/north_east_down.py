"""Signs that an odometry counts x north, y east, z down instead of x, y left, z up (REP-103)."""

from typing import List, Optional, Sequence

import numpy as np

from mlsm_manager.matching.problem.scan import Scan
from node_support.geometry.planar import composed, inverse

# m: more than waves and the drift of a depth sensor make. A vehicle that starts at the surface cannot climb so far.
_CLIMB = 2.0
# rad: turns between two scans that tell a direction: more than the beams' step, less than what makes a scan smeared.
_LEAST_TURN, _GREATEST_TURN = 0.15, 1.2
# Bearings are compared in steps of 3 deg, as most heads make them; a quarter of them has to hold echoes in both scans.
_SECTORS = 120
_LEAST_COMMON = _SECTORS // 4
# m: ranges that differ by more say no more than that something else is seen.
_OTHER_SURFACE = 5.0
# Pairs of scans that turned, and the share of them that has to speak against the odometry.
_LEAST_PAIRS = 5
_SHARE = 0.75


def suspicions(heights: np.ndarray, scans: Sequence[Scan]) -> List[str]:
    """Return one line for each sign of z down; none where nothing speaks for it.

    heights: (n,) z of the sonar in odom, m, one for each beam.
    """
    found = []
    climb, dive = float(heights.max() - heights[0]), float(heights[0] - heights.min())
    if climb > _CLIMB and climb > dive:
        found.append(f"z grows by {climb:.1f} m from the start, as a depth does")
    against = yaw_contradiction(scans)
    if against is not None:
        found.append(f"in {100.0 * against:.0f} % of the turns the echoes drift with the yaw instead of against it")
    return found


def yaw_contradiction(scans: Sequence[Scan]) -> Optional[float]:
    """Return the share of pairs of scans that fit the opposite turn better; None where it is not most of them."""
    votes = [_fits_opposite_turn(earlier, later) for earlier, later in zip(scans, scans[1:])]
    known = [vote for vote in votes if vote is not None]
    if len(known) < _LEAST_PAIRS or np.mean(known) < _SHARE:
        return None
    return float(np.mean(known))


def _fits_opposite_turn(earlier: Scan, later: Scan) -> Optional[bool]:
    turn = float(later.reference_pose[2] - earlier.reference_pose[2])
    if not _LEAST_TURN <= abs(turn) <= _GREATEST_TURN:
        return None
    before, after = _nearest_ranges(earlier), _nearest_ranges(later)
    shift = round(turn / (2.0 * np.pi) * _SECTORS)
    as_told, opposite = _difference(np.roll(before, -shift), after), _difference(np.roll(before, shift), after)
    return None if as_told is None or opposite is None else opposite < as_told


def _nearest_ranges(scan: Scan) -> np.ndarray:
    """Return (sectors,) the nearest echo around the vehicle, m, NaN where none is."""
    poses = scan.track.at(scan.times)
    placed = np.column_stack([scan.points[:, :2], np.zeros(len(scan))])
    seen = composed(inverse(poses), placed)
    sector = np.floor(np.arctan2(seen[:, 1], seen[:, 0]) / (2.0 * np.pi) * _SECTORS).astype(int) % _SECTORS
    ranges = np.full(_SECTORS, np.inf)
    np.minimum.at(ranges, sector, np.hypot(seen[:, 0], seen[:, 1]))
    return np.where(np.isfinite(ranges), ranges, np.nan)


def _difference(one: np.ndarray, other: np.ndarray) -> Optional[float]:
    differences = np.abs(one - other)
    common = np.isfinite(differences)
    if np.count_nonzero(common) < _LEAST_COMMON:
        return None
    return float(np.minimum(differences[common], _OTHER_SURFACE).mean())
