"""Whether a current carried the vehicle for a while that the odometry did not feel, as where a DVL loses the bottom.

Pairs of scans show it: those of a stretch lie on each other once each is moved by a velocity times its time.
"""

from typing import List, NamedTuple, Optional, Tuple

import numpy as np

from mlsm_manager.odometry.faults import FaultKind, MotionFault
from mlsm_manager.self_check.causes import Cause
from mlsm_manager.self_check.hypotheses import Hypothesis, NearPairs, ScanPairs, evidence_of
from node_support.geometry import grid

_SPEEDS = np.arange(-0.6, 0.61, 0.15)  # m/s, along x and y: currents that a small vehicle is used in
_STANDS = 0.01  # m/s: none
_FINER = (0.05, 0.02)  # m/s
_FARTHER = 1.3  # times as far as scans lie apart usually: less is no reason to look
_SCANS = 12  # of a stretch: a current that is there for longer the solver finds
_FEWEST = 3  # pairs


class _Stretch(NamedTuple):
    """first, last: scans. velocity: (2,) m/s in the frame of the pairs. nats: over a vehicle that was not carried."""

    first: int
    last: int
    velocity: np.ndarray
    nats: float


def carried(pairs: ScanPairs, base: Hypothesis) -> List[Cause]:
    """Return when and how fast the vehicle was carried, if it was; base: what is right besides."""
    near = pairs.near(base)
    found = _likeliest(pairs, near, base)
    if found is None or not np.isfinite(found.nats):
        return []
    begin, end = near.middles[[found.first, found.last]]
    velocity = pairs.in_odometry(_refined(pairs, near, found, base), begin, base)
    fault = MotionFault(FaultKind.CARRIED, float(begin), tuple(velocity.tolist()), float(end))
    way = float(np.hypot(*velocity) * (end - begin))
    return [Cause(fault.text, found.nats, fault.begin, metres=way, fault=fault)]


def _likeliest(pairs: ScanPairs, near: NearPairs, base: Hypothesis) -> Optional[_Stretch]:
    """Return the likeliest stretch; its evidence is less by the logarithm of how many were tried."""
    count, usual = len(near.middles), float(np.median(near.distances))
    stretches = [(first, last) for first in range(count) for last in range(first + 2, min(count, first + _SCANS + 1))]
    inside = {one: near.within(*one) for one in stretches}
    inside = {
        one: within
        for one, within in inside.items()
        if within.sum() >= _FEWEST and near.distances[within].mean() > _FARTHER * usual
    }
    if not inside:
        return None
    speeds = grid(_SPEEDS)
    speeds = speeds[np.hypot(*speeds.T) > _STANDS]
    needed = np.any(list(inside.values()), axis=0)
    table = np.full((len(speeds), len(needed)), np.nan)
    table[:, needed] = pairs.carried(near.pairs[needed], speeds, base)
    tried = np.log(len(stretches) * len(speeds))
    return max((_judged(one, within, near, table, speeds, tried) for one, within in inside.items()), key=_nats)


def _judged(
    one: Tuple[int, int], within: np.ndarray, near: NearPairs, table: np.ndarray, speeds: np.ndarray, tried: float
) -> _Stretch:
    """Return the likeliest velocity of a stretch, `one` from scan to scan; table: distances by speed and pair."""
    row = int(table[:, within].mean(axis=1).argmin())
    apart, alike = near.distances[within], near.distances[~within]
    if len(alike) < _FEWEST:
        return _Stretch(*one, speeds[row], -np.inf)
    nats = evidence_of(apart, table[row, within], one[1] - one[0], alike) - tried
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
