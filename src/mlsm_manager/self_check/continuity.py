"""Do scans lie on what was heard just before them?

A solver that knows no velocity can hold on to a wrong place: where a scan does not fit, few of its points are compared,
and these agree. The points that are compared with nothing tell it.
"""

import numpy as np

from mlsm_manager.self_check.verdict import Verdict, merged

_LIES = 0.5  # share of a scan's points on surfaces heard before, from which on the scan lies there
_SCANS = 20  # as many as the check of agreement looks at


def scans_go_on(times: np.ndarray, shares: np.ndarray, limit: float = 0.9) -> Verdict:
    """Return which share of any 20 following scans lies on what was heard before, at least.

    times: (n,) s of the scans' ends. shares: (n,) of each scan's points that lie on surfaces heard before; NaN for a
    scan without any. Where the path is right, hardly a scan has less than half of its points there. One or two may, as
    a vehicle that comes around a corner hears new water.
    """
    known = np.isfinite(shares)
    times, lies = np.asarray(times)[known], np.asarray(shares)[known] >= _LIES
    name, text = "scans go on", f"share of {_SCANS} scans that lie on what was heard before them"
    question = "Do scans lie on what was heard just before them, or has the vehicle moved as it was not expected to?"
    if len(lies) < _SCANS:
        return Verdict(name, np.nan, limit, text, True, question=question)
    total = np.cumsum(np.append(0.0, lies))
    part = (total[_SCANS:] - total[:-_SCANS]) / _SCANS
    starts = times[: len(part)][part < limit]
    doubtful = merged(starts, float(np.median(np.diff(times))) * (_SCANS - 1))
    return Verdict(name, float(part.min()), limit, text, True, doubtful, question)
