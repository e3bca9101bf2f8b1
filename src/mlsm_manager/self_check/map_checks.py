"""Is the place of all scans in the map known, or do some lie apart since the sonar heard nothing for a while?"""

from datetime import datetime, timezone
from typing import Tuple

import numpy as np

from mlsm_manager.self_check.verdict import Verdict, merged

_WINDOW = 20  # as many as the check of agreement looks at
_MAY_BE_BESIDE = 0.2  # share of these: a vehicle that comes around a corner hears new water
_AGREES = 0.5  # share of a scan's points on known surfaces from which on the scan agrees: the larger part
_GOOD_ODOMETRY = 0.1  # relative deviation of reported distances up to which these tell the way along a canal
_RECORDED, _LATEST = 1e9, 2.0**31  # s since 1970 of clocks that tell the time: simulated ones begin near 0
_SCANS = 10  # about 2 minutes, in which a small vehicle passes what it hears


def in_one_map(times: np.ndarray, apart: np.ndarray) -> Tuple[Verdict, ...]:
    """Return a verdict on the share of scans whose place in the map is known; none where that is every scan's.

    times: (n,) s of the scans' ends. apart: (n,) bool, whether a scan lies where nobody knows how it fits to the map.
    """
    if not apart.any():
        return ()
    share, step = float(1.0 - apart.mean()), float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    text = "share of the scans whose place in the map is known; after a silence the others fit at none, or at several"
    question = "Is the place in the map of all scans known, also after the sonar heard nothing for a while?"
    return (Verdict("one map", share, 1.0, text, True, merged(times[apart] - step, step), question),)


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
    text = f"share of its echoes that each of {_WINDOW} scans but the worst fifth has on what was heard before it; "
    text += "a vehicle that strafes needs --odometry hovering"
    question = "Do scans lie on what was heard just before them, or has the vehicle moved as it was not expected to?"
    if len(shares) < _WINDOW:
        return Verdict(name, np.nan, limit, text, True, question=question)
    windows = np.arange(len(shares) - _WINDOW + 1)[:, np.newaxis] + np.arange(_WINDOW)
    values = np.quantile(shares[windows], _MAY_BE_BESIDE, axis=1)
    starts = times[: len(values)][values < limit]
    doubtful = merged(starts, float(np.median(np.diff(times))) * (_WINDOW - 1))
    return Verdict(name, float(values.min()), limit, text, True, doubtful, question)


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


def surfaces_tell(
    begin: float, times: np.ndarray, surfaces: np.ndarray, distance_deviation: float, limit: float = 0.05
) -> Tuple[Verdict, ...]:
    """Return a verdict on what some following scans together tell of the direction that they tell least of.

    begin: s, of the run. times: (n,) s of the scans' ends. surfaces: (n, 2, 2) sums of the outer products of the
    normals that each scan met. distance_deviation: relative one of the odometry's distances; there is no verdict where
    the odometry tells the way.
    limit: least share of what they tell of the direction that they tell most of; normals err by 0.2 rad, which makes
    0.04 of a straight wall.
    """
    if distance_deviation <= _GOOD_ODOMETRY:
        return ()
    name, text = "surfaces on all sides", "share that the weakest direction has"
    question = "Do the surfaces that were heard tell the position in all directions?"
    if len(times) < _SCANS:
        return (Verdict(name, np.nan, limit, text, True, question=question),)
    total = np.cumsum(np.concatenate([np.zeros((1, 2, 2)), surfaces]), axis=0)
    values, vectors = np.linalg.eigh(total[_SCANS:] - total[:-_SCANS])
    shares = np.divide(values[:, 0], values[:, 1], out=np.zeros(len(values)), where=values[:, 1] > 0.0)
    weak, worst = shares < limit, int(np.argmin(shares))
    starts = np.asarray(times)[: len(shares)]
    if weak.any():
        way = f"next to nothing tells the way along {_degrees(vectors[worst, :, 0])} deg"
        text = f"from {_moment(starts[weak][0], begin)} on, {way}"
    doubtful = merged(starts[weak], float(np.median(np.diff(times))) * (_SCANS - 1))
    return (Verdict(name, float(shares[worst]), limit, text, True, doubtful, question),)


def _moment(time: float, begin: float) -> str:
    """Return when `time` [s] was, for people: seconds into the run, and the clock's time unless it is simulated."""
    into = f"{time - begin:.0f} s into the run"
    if not _RECORDED < time < _LATEST:
        return into
    return f"{into} ({datetime.fromtimestamp(time, timezone.utc):%H:%M:%S} UTC)"


def _degrees(direction: np.ndarray) -> int:
    """Return the angle of a direction (2,) in map, from 0 to 179 degrees."""
    return round(float(np.degrees(np.arctan2(direction[1], direction[0])))) % 180
