"""Do scans lie on what was heard just before them?

A solver that knows no velocity can hold on to a wrong place: where a scan does not fit, few of its points are compared,
and these agree. The points that lie beside what was heard before tell it.
"""

import numpy as np

from mlsm_manager.self_check.verdict import Verdict, merged

_SCANS = 20  # as many as the check of agreement looks at
_MAY_BE_BESIDE = 0.2  # share of these: a vehicle that comes around a corner hears new water


def scans_go_on(times: np.ndarray, shares: np.ndarray, limit: float = 0.65) -> Verdict:
    """Return what share of its points four of five scans at least have on what was heard before, in any 20 scans.

    times: (n,) s of the scans' ends. shares: (n,) of each scan's points that lie on surfaces heard before; NaN for a
    scan that does not tell.
    limit: on simulated tours and twins of a marina, paths that were right had 0.70 and more, those that were wrong by
    more than 10 m had 0.60 and less.
    """
    known = np.isfinite(shares)
    times, shares = np.asarray(times)[known], np.asarray(shares)[known]
    name = "scans go on"
    text = f"share of its echoes that each of {_SCANS} scans but the worst fifth has on what was heard before it; "
    text += "a vehicle that strafes needs --odometry hovering"
    question = "Do scans lie on what was heard just before them, or has the vehicle moved as it was not expected to?"
    if len(shares) < _SCANS:
        return Verdict(name, np.nan, limit, text, True, question=question)
    windows = np.arange(len(shares) - _SCANS + 1)[:, np.newaxis] + np.arange(_SCANS)
    values = np.quantile(shares[windows], _MAY_BE_BESIDE, axis=1)
    starts = times[: len(values)][values < limit]
    doubtful = merged(starts, float(np.median(np.diff(times))) * (_SCANS - 1))
    return Verdict(name, float(values.min()), limit, text, True, doubtful, question)
