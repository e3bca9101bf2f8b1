"""When the beams were sent, by the odometry's clock: all later than their stamps, or from a moment on, or ever more."""

from itertools import product
from typing import List, Tuple

import numpy as np

from mlsm_manager.odometry.faults import FaultKind, MotionFault
from mlsm_manager.self_check.causes import NAMED_FROM, Cause
from mlsm_manager.self_check.scan_pairs import AS_TOLD, Hypothesis, ScanPairs, around, evidence_of

LATE = around(AS_TOLD, "delay", np.arange(-12.0, 13.0, 2.0))  # that may hold all along
LATE_BY = 1.0  # m, by which wrong stamps make the path unsure: what a small vehicle goes in some seconds
_LATE_TOLD = 3.0  # s: three deviations of what is known of a head's delay
_DELAYS = np.arange(-8.0, 8.5, 0.5)  # s, before and after a change, or at the beginning and at the end
_FEWEST = 6  # pairs of scans that tell a delay


def late(pairs: ScanPairs, honest: Hypothesis) -> List[Cause]:
    """Return that all beams are later than their stamps, or earlier, where that is likelier than `honest`."""
    found = pairs.best(LATE)
    nats = pairs.evidence(found, honest) - np.log(len(LATE))
    return [late_cause(found.delay, nats)] if abs(found.delay) > _LATE_TOLD and nats >= NAMED_FROM else []


def late_cause(delay: float, nats: float) -> Cause:
    """Return the cause for beams that are `delay` [s] later than their stamps."""
    side = "later" if delay > 0.0 else "earlier"
    text = f"beams were sent {abs(delay):.0f} s {side} than their stamps, by the odometry's clock"
    return Cause(text, nats, metres=LATE_BY)


_Delays = Tuple[np.ndarray, MotionFault]
"""The number of the delay at each pair (p,), in _DELAYS, and the fault with which it is so."""


def suspected_delays(pairs: ScanPairs, base: Hypothesis) -> List[MotionFault]:
    """Return the likeliest change of the beams' delay, and the likeliest growth, each if it is likelier than none.

    base: what is right besides.
    """
    table, times = np.array([pairs.distances(one) for one in around(base, "delay", _DELAYS)]), pairs.times.mean(axis=1)
    even, numbers = table[table.mean(axis=1).argmin()], np.arange(len(times))
    found = []
    for kind in filter(None, (_changes(table, times), _growths(times))):
        apart, fault = min(((table[rows, numbers], fault) for rows, fault in kind), key=lambda tried: tried[0].mean())
        if evidence_of(even, apart, pairs.scans) > NAMED_FROM:
            found.append(fault)
    return found


def _changes(table: np.ndarray, times: np.ndarray) -> List[_Delays]:
    """Return the likeliest delays before and after each moment with enough pairs on both sides.

    table: (k, p) m, how far pairs at `times` (p,) [s] lie apart with each delay.
    """
    found = []
    for begin in np.unique(times)[_FEWEST:-_FEWEST].tolist():
        before = times < begin
        first, last = (int(table[:, which].mean(axis=1).argmin()) for which in (before, ~before))
        fault = MotionFault(FaultKind.LATER, begin, (float(_DELAYS[last] - _DELAYS[first]),))
        found.append((np.where(before, first, last), fault))
    return found


def _growths(times: np.ndarray) -> List[_Delays]:
    """Return delays that grow evenly, from any one to any other."""
    found, seconds = [], max(float(np.ptp(times)), 1.0)
    since = (times - times[0]) / seconds
    for first, last in product(range(len(_DELAYS)), repeat=2):
        rows = np.round(first + since * (last - first)).astype(int)
        rate = float(_DELAYS[last] - _DELAYS[first]) / seconds
        found.append((rows, MotionFault(FaultKind.EVER_LATER, float(times[0]), (rate,))))
    return found
