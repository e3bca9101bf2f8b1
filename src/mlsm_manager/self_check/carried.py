"""Whether a current carried the vehicle for a while that the odometry did not feel, as where a DVL loses the bottom.

Pairs of scans show it: those of a stretch lie on each other once each is moved by a velocity times its time.
"""

from typing import Dict, List, NamedTuple

import numpy as np

from mlsm_manager.odometry.faults import FaultKind, MotionFault
from mlsm_manager.self_check.causes import Cause
from mlsm_manager.self_check.scan_pairs import Hypothesis, ScanPairs, evidence_of
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
    """first, last: numbers of scans. pairs: (p, 2) of these. velocity: (2,) m/s in the frame of the pairs.

    nats: over a vehicle that was not carried.
    """

    first: int
    last: int
    pairs: np.ndarray
    velocity: np.ndarray
    nats: float


def carried(pairs: ScanPairs, base: Hypothesis, farther: float = 0.0) -> List[Cause]:
    """Return when and how fast the vehicle may have been carried, the likeliest first.

    base: what is right besides. farther: times as far as usual that the scans lie apart at least.
    """
    likely = [found for found in _likeliest(pairs, base, farther) if found.nats > _LEAST]
    return [_cause(pairs, found, base) for found in likely if _is_told(pairs, found, base)]


def _is_told(pairs: ScanPairs, found: _Stretch, base: Hypothesis) -> bool:
    """Return whether enough surfaces face along the velocity of a stretch to tell it.

    Between the walls of a canal a vehicle hears the same whether it moves or stands.
    """
    along = found.velocity / np.hypot(*found.velocity)
    share = along @ pairs.facing(range(found.first, found.last + 1), base) @ along
    return bool(share > _FACING)


def _cause(pairs: ScanPairs, found: _Stretch, base: Hypothesis) -> Cause:
    """Return the cause with the velocity more exactly than it was looked for."""
    velocity = found.velocity
    for step in _FINER:
        tried = velocity + step * grid(np.arange(-2, 3))
        velocity = tried[pairs.carried(found.pairs, tried, base).mean(axis=1).argmin()]
    begin, end = pairs.middles[[found.first, found.last]].tolist()
    velocity = pairs.in_odometry(velocity, begin, base)
    fault = MotionFault(FaultKind.CARRIED, begin, tuple(velocity.tolist()), end)
    way = float(np.hypot(*velocity) * (end - begin))
    return Cause(fault.text, found.nats, begin, metres=way, fault=fault)


def _likeliest(pairs: ScanPairs, base: Hypothesis, farther: float) -> List[_Stretch]:
    """Return the likeliest stretches, each of another number of scans; farther: see `carried`.

    Their evidence is less by the logarithm of how many were tried.
    """
    numbers, distances = pairs.near(base)
    count, speeds, apart = len(pairs.middles), grid(_SPEEDS), farther * float(np.median(distances))
    speeds = speeds[np.hypot(*speeds.T) > _STANDS]
    stretches = [(first, last) for first in range(count) for last in range(first + 2, min(count, first + _SCANS + 1))]
    table, tried = pairs.carried(numbers, speeds, base), np.log(len(stretches) * len(speeds))
    best: Dict[int, _Stretch] = {}
    for first, last in stretches:
        within, size = (numbers[:, 0] >= first) & (numbers[:, 1] <= last), last - first
        if min(within.sum(), (~within).sum()) < _FEWEST or distances[within].mean() <= apart:
            continue
        row = int(table[:, within].mean(axis=1).argmin())
        nats = evidence_of(distances[within], table[row, within], size, distances[~within]) - tried
        if size not in best or nats > best[size].nats:
            best[size] = _Stretch(first, last, numbers[within], speeds[row], nats)
    return sorted(best.values(), key=lambda one: -one.nats)[:_MOST]
