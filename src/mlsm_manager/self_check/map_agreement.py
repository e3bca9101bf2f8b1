"""Do the scans still meet the map that they made?"""

import numpy as np

from mlsm_manager.self_check.verdict import Verdict, merged

_AGREES = 0.5  # share of a scan's points on known surfaces from which on the scan agrees: the larger part


def recent_agreement(
    times: np.ndarray, agreements: np.ndarray, scans: int = 20, limit: float = 0.5, agrees: float = _AGREES
) -> Verdict:
    """Return the share of the last `scans` scans that agree with the map.

    times: (n,) s of the ends of scans that heard something. agreements: (n,) share of each scan's points that lie on
    surfaces of others.
    """
    good = np.asarray(agreements[-scans:]) >= agrees
    value = float(good.mean()) if len(agreements) >= scans else np.nan
    return Verdict(
        "scans on the map",
        value,
        limit,
        f"share of the last {scans} scans",
        True,
        _lost(times, agreements, scans, limit, agrees),
        "Do the newest scans lie on the map that earlier scans made?",
    )


def _lost(times: np.ndarray, agreements: np.ndarray, scans: int, limit: float, agrees: float) -> np.ndarray:
    """Return stretches (k, 2) [s] in which too few of `scans` scans agreed."""
    if len(agreements) < scans:
        return np.empty((0, 2))
    total = np.cumsum(np.concatenate([[0.0], np.asarray(agreements) >= agrees]))
    share = (total[scans:] - total[:-scans]) / scans
    return merged(np.asarray(times)[: len(share)][share < limit], float(np.median(np.diff(times))) * (scans - 1))
