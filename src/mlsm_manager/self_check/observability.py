"""Do the surfaces that were heard tell the position in all directions?

The walls of a canal, or a single wall, do not tell the way along them. A vehicle whose odometry reports no distances
then goes on as before, and nothing shows how far.
"""

from datetime import datetime, timezone
from typing import Tuple

import numpy as np

from mlsm_manager.self_check.verdict import Verdict, merged

_GOOD_ODOMETRY = 0.1  # relative deviation of reported distances up to which these tell the way along a canal
_RECORDED, _LATEST = 1e9, 2.0**31  # s since 1970 of clocks that tell the time: simulated ones begin near 0
_SCANS = 10  # about 2 minutes, in which a small vehicle passes what it hears


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
