"""Cuts a turn of the head into parts, so that the vehicle's speed may change within it."""

from typing import List, Optional

import numpy as np

from mlsm_manager.scan_matching.scan import Scan

_SHORTEST_TURN = 1.0  # s: a first scan without points still needs a beginning before its end


def parts_of(scan: Scan, count: int, newest: Optional[float]) -> List[Scan]:
    """Return `count` scans of equal durations that follow each other, with the points of each.

    newest: s, end of the scan before; None without one.
    """
    if count == 1:
        return [scan]
    start = _start(scan, newest)
    ends = np.linspace(start, scan.reference_time, count + 1)[1:]
    ends[-1] = scan.reference_time
    part_of_point = np.minimum(np.searchsorted(ends, scan.times), count - 1)
    return [_selected(scan, part_of_point == part, end) for part, end in enumerate(ends)]


def _start(scan: Scan, newest: Optional[float]) -> float:
    """Return when the turn began [s]; a scan without points, or with one beam, does not tell."""
    if newest is None:
        return min(scan.start, scan.reference_time - _SHORTEST_TURN)
    return max(scan.start, newest) if scan.start < scan.reference_time else newest


def _selected(scan: Scan, rows: np.ndarray, end: float) -> Scan:
    return Scan(scan.points[rows], scan.times[rows], scan.moving[rows], scan.track, float(end))
