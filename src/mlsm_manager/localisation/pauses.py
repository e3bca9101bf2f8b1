"""Fills pauses in which no scan came with scans that heard nothing, so that the motion in a pause has nodes too."""

from typing import List

import numpy as np

from mlsm_manager.scan_matching.scan import Scan

_LONGEST_PAUSE = 2.0
"""Usual durations of a scan between two scans: fewer may be a turn that was lost."""
_MOST_SCANS = 30
"""For one pause, which bounds the time that it costs; in longer ones they are farther apart."""


def scans_of_pause(scan: Scan, node_times: np.ndarray) -> List[Scan]:
    """Return scans without points from the newest of node_times (n,) [s] to the beginning of `scan`, n > 0.

    None where that is less than a pause. The last one ends where the scan begins, so that the vehicle's motion within
    the scan does not hang on that in the pause.
    """
    if len(node_times) < 2:
        return []
    newest, usual = node_times[-1], float(np.median(np.diff(node_times)))
    count = min(round((scan.start - newest) / usual), _MOST_SCANS)
    if scan.start - newest <= _LONGEST_PAUSE * usual:
        return []
    return [scan.without_points(float(end)) for end in np.linspace(newest, scan.start, count + 1)[1:]]
