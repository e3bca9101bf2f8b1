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


class ZDownSigns:
    """Collects the signs scan by scan, for a run that is still going on."""

    def __init__(self, start: float = 0.0) -> None:
        """`start`: z that the vehicle is compared with, m; 0 is the surface, or where the odometry began."""
        self._start = self._lowest = self._highest = start
        self._previous: Optional[Scan] = None
        self._pairs = self._against = 0

    def take_heights(self, heights: np.ndarray) -> None:
        """Take (n,) z of the vehicle in odom, m, n > 0."""
        self._lowest = min(self._lowest, float(heights.min()))
        self._highest = max(self._highest, float(heights.max()))

    def take_scan(self, scan: Scan) -> None:
        """Compare a scan with the one before it."""
        vote = None if self._previous is None else _fits_opposite_turn(self._previous, scan)
        self._previous = scan
        if vote is not None:
            self._pairs += 1
            self._against += int(vote)

    def lines(self) -> List[str]:
        """Return one line for each sign; none where nothing speaks for z down."""
        found = []
        climb, dive = self._highest - self._start, self._start - self._lowest
        if climb > _CLIMB and climb > dive:
            found.append(f"z grows by {climb:.1f} m from the start, as a depth does")
        share = self._against / max(self._pairs, 1)
        if self._pairs >= _LEAST_PAIRS and share >= _SHARE:
            found.append(f"in {100.0 * share:.0f} % of the turns the echoes drift with the yaw instead of against it")
        return found


def suspicions(heights: np.ndarray, scans: Sequence[Scan]) -> List[str]:
    """Return one line for each sign of z down in a whole recording; none where nothing speaks for it.

    heights: (n,) z of the sonar in odom, m, one for each beam.
    """
    signs = ZDownSigns(float(heights[0]))
    signs.take_heights(heights)
    for scan in scans:
        signs.take_scan(scan)
    return signs.lines()


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
