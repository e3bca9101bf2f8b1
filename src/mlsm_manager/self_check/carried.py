"""Whether a current carried the vehicle for a while that the odometry did not feel, as where a DVL loses the bottom.

Pairs of scans show it: those of a stretch lie on each other once each is moved by a velocity times its time.
"""

from typing import Dict, List, NamedTuple, Tuple

import numpy as np

from mlsm_manager.odometry.faults import FaultKind, MotionFault
from mlsm_manager.self_check.causes import Cause
from mlsm_manager.self_check.scan_pairs import Hypothesis, NearPairs, ScanPairs, evidence_of
from node_support.geometry import grid

_SPEEDS = np.arange(-0.6, 0.61, 0.15)  # m/s, along x and y: currents that a small vehicle is used in
_STANDS = 0.01  # m/s: none
_FINER = (0.05, 0.02)  # m/s
_SCANS = 12  # of a stretch: a current that is there for longer the solver finds
_FEWEST = 3  # pairs
_LEAST = -5.0  # nats: unbroken recordings show -5.5 and less, and a bottom that was lost -4.6 and more
_FACING = 0.3  # mean squared cosine; .5 with surfaces all around. In a marina's canal .13 to .24, elsewhere .39 to .73
_MOST = 3  # stretches: pairs tell how long one is worse than a fit does


class _Stretch(NamedTuple):
    """first, last: scans. velocity: (2,) m/s in the frame of the pairs. nats: over a vehicle that was not carried."""

    first: int
    last: int
    velocity: np.ndarray
    nats: float


def carried(pairs: ScanPairs, base: Hypothesis, farther: float = 0.0) -> List[Cause]:
    """Return when and how fast the vehicle may have been carried, the likeliest first.

    base: what is right besides. farther: times as far as usual that the scans lie apart at least.
    """
    near = pairs.near(base)
    likeliest = _likeliest(pairs, near, base, farther * float(np.median(near.distances)))
    likely = [found for found in likeliest if found.nats > _LEAST]
    return [_cause(pairs, near, found, base) for found in likely if _is_told(pairs, found, base)]


def _is_told(pairs: ScanPairs, found: _Stretch, base: Hypothesis) -> bool:
    """Return whether enough surfaces face along the velocity of a stretch to tell it.

    Between the walls of a canal a vehicle hears the same whether it moves or stands.
    """
    along = found.velocity / np.hypot(*found.velocity)
    share = along @ pairs.facing(range(found.first, found.last + 1), base) @ along
    return bool(share > _FACING)


def _cause(pairs: ScanPairs, near: NearPairs, found: _Stretch, base: Hypothesis) -> Cause:
    begin, end = near.middles[[found.first, found.last]]
    velocity = pairs.in_odometry(_refined(pairs, near, found, base), begin, base)
    fault = MotionFault(FaultKind.CARRIED, float(begin), tuple(velocity.tolist()), float(end))
    way = float(np.hypot(*velocity) * (end - begin))
    return Cause(fault.text, found.nats, fault.begin, metres=way, fault=fault)


def _likeliest(pairs: ScanPairs, near: NearPairs, base: Hypothesis, apart: float) -> List[_Stretch]:
    """Return the likeliest stretches, each of another number of scans, which lie `apart` [m] or more; their evidence is
    less by the logarithm of how many were tried.
    """
    count, speeds = len(near.middles), grid(_SPEEDS)
    speeds = speeds[np.hypot(*speeds.T) > _STANDS]
    stretches = [(first, last) for first in range(count) for last in range(first + 2, min(count, first + _SCANS + 1))]
    table, tried = pairs.carried(near.pairs, speeds, base), np.log(len(stretches) * len(speeds))
    best: Dict[int, _Stretch] = {}
    for first, last in stretches:
        within = near.within(first, last)
        if min(within.sum(), (~within).sum()) >= _FEWEST and near.distances[within].mean() > apart:
            found = _judged((first, last), within, near, table, speeds)
            best[last - first] = max(best.get(last - first, found), found, key=_nats)
    ordered = sorted(best.values(), key=_nats, reverse=True)[:_MOST]
    return [found._replace(nats=found.nats - tried) for found in ordered]


def _judged(
    one: Tuple[int, int], within: np.ndarray, near: NearPairs, table: np.ndarray, speeds: np.ndarray
) -> _Stretch:  # fmt: skip
    """Return the likeliest velocity of a stretch, `one` from scan to scan; table: distances by speed and pair."""
    row = int(table[:, within].mean(axis=1).argmin())
    nats = evidence_of(near.distances[within], table[row, within], one[1] - one[0], near.distances[~within])
    return _Stretch(*one, speeds[row], nats)


def _nats(stretch: _Stretch) -> float:
    return stretch.nats


def _refined(pairs: ScanPairs, near: NearPairs, found: _Stretch, base: Hypothesis) -> np.ndarray:
    """Return the velocity (2,) [m/s] more exactly than it was looked for."""
    velocity, chosen = found.velocity, near.pairs[near.within(found.first, found.last)]
    for step in _FINER:
        tried = velocity + step * grid(np.arange(-2, 3))
        velocity = tried[pairs.carried(chosen, tried, base).mean(axis=1).argmin()]
    return velocity
