"""Signs that an odometry counts z down, not x, y left, z up as in REP-103, or that a head turns the other way."""

from typing import List, Optional, Sequence

import numpy as np

from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.self_check.compiled_distances import along_x, mean_distance
from mlsm_manager.self_check.verdict import Verdict, percent
from node_support.geometry import composed, seen_from

# m: more than waves and the drift of a depth sensor make. A vehicle that starts at the surface cannot climb so far.
_CLIMB = 2.0
_AS_REPORTED, _TURNED_UP = np.array([1.0, 1.0, 1.0]), np.array([1.0, -1.0, -1.0])  # times x, y and yaw
# Echoes of a scan: with fewer their mean distance tells little, and more take time and tell nothing new.
_FEWEST, _MOST = 30, 1000
_OTHER_SURFACE = 5.0  # m: echoes that are farther from all others say no more than that something else is seen
_CLEARLY = 1.2  # times: by less the two odometries do not differ, as on a straight way or where the vehicle stands
_LEAST_PAIRS, _SHARE = 5, 0.7  # pairs that tell the two apart, and the share that may speak against the odometry


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
        vote = None if self._previous is None else _fits_turned_up(self._previous, scan)
        self._previous = scan
        self._pairs += vote is not None
        self._against += bool(vote)

    def lines(self) -> List[str]:
        """Return one line for each sign; none where nothing speaks for z down."""
        found = []
        climb, dive = self._highest - self._start, self._start - self._lowest
        if climb > _CLIMB and climb > dive:
            found.append(f"z grows by {climb:.1f} m from the start, as a depth does")
        turns = self.turns()
        if turns.fires:
            found.append(f"in {100.0 * turns.value:.0f} % of the scans the echoes fit better with y and yaw reversed")
        return found

    def turns(self) -> Verdict:
        """Return whether the echoes turn as the odometry does."""
        name, question = "turns of odometry and echoes", "When the vehicle turns, do the walls stay where they are?"
        if self._pairs < _LEAST_PAIRS:
            text = f"only {self._pairs} pairs of scans show which way the vehicle turned, {_LEAST_PAIRS} needed"
            return Verdict(name, np.nan, _SHARE, text, question=question)
        share = self._against / self._pairs
        figures = f"{percent(share)} of {self._pairs} pairs of scans fit better the other way, limit {percent(_SHARE)}"
        text = f"echoes turn as the odometry does ({figures})"
        if share > _SHARE:
            text = "echoes turn against the odometry: it counts z down, or the head turns the other way than its "
            text += f"driver says ({figures})"
        return Verdict(name, share, _SHARE, text, question=question)


def z_down_signs(heights: np.ndarray, scans: Sequence[Scan]) -> ZDownSigns:
    """Return the signs of a whole recording. heights: (n,) z of the sonar in odom, m, one for each beam."""
    signs = ZDownSigns(float(heights[0]))
    signs.take_heights(heights)
    for scan in scans:
        signs.take_scan(scan)
    return signs


def _fits_turned_up(earlier: Scan, later: Scan) -> Optional[bool]:
    """Return whether two scans fit each other better with the odometry turned up; None where they do not tell."""
    if min(len(earlier), len(later)) < _FEWEST:
        return None
    as_reported, turned_up = (
        mean_distance(along_x(_placed(earlier, signs)), _placed(later, signs), _OTHER_SURFACE)
        for signs in (_AS_REPORTED, _TURNED_UP)
    )
    if max(as_reported, turned_up) < _CLEARLY * min(as_reported, turned_up):
        return None
    return turned_up < as_reported


def _placed(scan: Scan, signs: np.ndarray) -> np.ndarray:
    """Return (n, 2) echoes in odom, m, where the vehicle's poses are multiplied by `signs`."""
    chosen = slice(None, None, -(-len(scan) // _MOST))
    points, poses = scan.points[chosen, :2], scan.track.at(scan.times[chosen])
    seen = seen_from(poses, np.column_stack([points, np.zeros(len(points))]))
    return np.ascontiguousarray(composed(poses * signs, seen)[:, :2])
