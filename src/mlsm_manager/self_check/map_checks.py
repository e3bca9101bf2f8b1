"""Checks of scans against the map and each other: do they lie where they should, and do they tell the position?"""

from typing import Tuple

import numpy as np

from mlsm_manager.self_check.verdict import Verdict, merged, moment, percent

_WINDOW = 20  # scans in which some may lie beside the others
_MAY_BE_BESIDE = 0.2  # share of these: a vehicle that comes around a corner hears new water
AGREES = 0.5  # share of a scan's points on known surfaces from which on the scan agrees: the larger part
_GOOD_ODOMETRY = 0.1  # relative deviation of reported distances up to which these tell the way along a canal
_SCANS = 10  # about 2 minutes, in which a small vehicle passes what it hears


def in_submaps(times: np.ndarray, apart: np.ndarray) -> Tuple[Verdict, ...]:
    """Return a verdict on the share of scans whose place in the map is known; none where that is every scan's.

    times: (n,) s of the scans' ends. apart: (n,) bool, whether a scan lies in a submap of which nobody knows how it
    fits to the map, since the sonar heard nothing for a while.
    """
    if not apart.any():
        return ()
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    text = "the place of some scans in the map is unknown since a silence of the sonar: they fit nowhere, or at "
    text += f"several places ({np.count_nonzero(apart)} of {len(apart)} scans in submaps of their own)"
    question = "Is the place in the map of all scans known, also after the sonar heard nothing for a while?"
    doubtful = merged(times[apart] - step, step)
    return (Verdict("submaps", float(1.0 - apart.mean()), 1.0, text, True, doubtful, question),)


def scans_go_on(times: np.ndarray, shares: np.ndarray, limit: float = 0.65) -> Verdict:
    """Return the least, over windows of 20 scans, of the share that four of five of them have at least.

    A solver that knows no velocity can hold on to a wrong place: where a scan does not fit, few of its points are
    compared, and these agree. The points that lie beside what was heard before tell it.

    times: (n,) s of the scans' ends. shares: (n,) of each scan's points that lie on surfaces heard before; NaN for a
    scan that does not tell.
    limit: on simulated tours and twins of a marina, paths that were right had 0.70 and more, those that were wrong by
    more than 10 m had 0.60 and less.
    """
    known = np.isfinite(shares)
    times, shares = np.asarray(times)[known], np.asarray(shares)[known]
    name, question = "scans go on", "Do scans lie on what was heard just before them, so that the motion is as assumed?"
    if len(shares) < _WINDOW:
        return Verdict(name, np.nan, limit, f"fewer than {_WINDOW} scans that others precede", True, question=question)
    windows = np.arange(len(shares) - _WINDOW + 1)[:, np.newaxis] + np.arange(_WINDOW)
    values = np.quantile(shares[windows], _MAY_BE_BESIDE, axis=1)
    lowest, starts = float(values.min()), times[: len(values)][values < limit]
    figures = f"{percent(lowest)} of the echoes on earlier surfaces, at least {percent(limit)} needed"
    text = f"scans fit those before them ({figures})"
    if len(starts):
        text = "scans do not fit those before them; a vehicle with a compass that moves sideways needs "
        text += f"--odometry hovering (only {figures})"
    doubtful = merged(starts, float(np.median(np.diff(times))) * (_WINDOW - 1))
    return Verdict(name, lowest, limit, text, True, doubtful, question)


def recent_agreement(times: np.ndarray, agreements: np.ndarray, scans: int = 20, limit: float = 0.5) -> Verdict:
    """Return the share of the last `scans` scans that agree with the map.

    times: (n,) s of the ends of scans that heard something. agreements: (n,) share of each scan's points that lie on
    surfaces of others.
    """
    name, question = "scans on the map", "Do the newest scans lie on the map that earlier scans made?"
    if len(agreements) < scans:
        return Verdict(name, np.nan, limit, f"fewer than {scans} scans that heard something", True, question=question)
    total = np.cumsum(np.concatenate([[0.0], np.asarray(agreements) >= AGREES]))
    share = (total[scans:] - total[:-scans]) / scans
    newest, starts = float(share[-1]), np.asarray(times)[: len(share)][share < limit]
    doubtful = merged(starts, float(np.median(np.diff(times))) * (scans - 1))
    figures = f"{percent(newest)} of the last {scans} scans, at least {percent(limit)} needed"
    text = f"the newest scans lie on the map ({figures})"
    if newest < limit:
        text = f"the newest scans do not lie on the map: the vehicle has left it, or it is smeared (only {figures})"
    return Verdict(name, newest, limit, text, True, doubtful, question)


def surfaces_tell(
    begin: float, times: np.ndarray, surfaces: np.ndarray, distance_deviation: float, limit: float = 0.05
) -> Tuple[Verdict, ...]:
    """Return a verdict on what some following scans together tell of the direction that they tell least of.

    The walls of a canal, or a single wall, do not tell the way along them. A vehicle whose odometry reports no
    distances then goes on as before, and nothing shows how far.

    begin: s, of the run. times: (n,) s of the scans' ends. surfaces: (n, 2, 2) sums of the outer products of the
    normals that each scan met. distance_deviation: relative one of the odometry's distances; there is no verdict where
    the odometry tells the way.
    limit: least share of what they tell of the direction that they tell most of; normals err by 0.2 rad, which makes
    0.04 of a straight wall.
    """
    if distance_deviation <= _GOOD_ODOMETRY:
        return ()
    name, question = "surfaces on all sides", "Do the surfaces that were heard tell the position in all directions?"
    if len(times) < _SCANS:
        return (Verdict(name, np.nan, limit, f"fewer than {_SCANS} scans", True, question=question),)
    total = np.cumsum(np.concatenate([np.zeros((1, 2, 2)), surfaces]), axis=0)
    values, vectors = np.linalg.eigh(total[_SCANS:] - total[:-_SCANS])
    shares = np.divide(values[:, 0], values[:, 1], out=np.zeros(len(values)), where=values[:, 1] > 0.0)
    worst, starts = int(np.argmin(shares)), np.asarray(times)[: len(shares)][shares < limit]
    share = float(shares[worst])
    figures = f"weakest direction {percent(share, 1)} of the strongest, at least {percent(limit)} needed"
    text = f"walls tell the position in all directions ({figures})"
    if len(starts) and values[worst, 1] > 0.0:
        x, y = vectors[worst, :, 0]
        angle = round(float(np.degrees(np.arctan2(y, x)))) % 180
        text = (
            f"position along {angle} deg unknown since {moment(starts[0], begin)}: all walls are parallel ({figures})"
        )
    elif len(starts):
        text = f"position unknown since {moment(starts[0], begin)}: no walls were heard"
    doubtful = merged(starts, float(np.median(np.diff(times))) * (_SCANS - 1))
    return (Verdict(name, share, limit, text, True, doubtful, question),)
