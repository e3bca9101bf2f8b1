"""Names what is wrong with mounts, stamps and head: the hypothesis under which scans lie closest to each other."""

from dataclasses import dataclass
from typing import List, NamedTuple, Sequence

import numpy as np

from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.self_check.causes import Cause
from mlsm_manager.self_check.hypotheses import AS_TOLD, Hypothesis, ScanPairs, around, evidence_of

_COARSE, _FINE = np.radians(15.0), np.radians(3.0)
_TURN_TOLD = np.radians(17.2)  # three deviations of a mounting angle set by eye
_DELAY_TOLD = 3.0  # s: three deviations of what is known of a head's delay
_ARM_TOLD = 1.25  # m: nobody measures a mount worse; below, the echoes do not tell it
_SLIP_TOLD = np.radians(15.0)  # what half a run's scans tell to three deviations
_NATS, _SLIP_NATS = 12.0, 6.0  # evidence from which on a cause is named; of a slip both sides must agree besides
_ARM_NATS = 5.0  # an arm shows only in turns; no unbroken run had 5 nats for one above a metre
_ONE_SIDE = 8  # scans before and after a slip that begin a pair: of fewer an unbroken run has had a slip by chance
TURN_DEVIATION = np.radians(5.0)  # of a turn that is found so


class EchoFindings(NamedTuple):
    """causes: that are named. mount: the likeliest mount, where one is named; else that of tf."""

    causes: List[Cause]
    mount: Hypothesis


def echo_findings(scans: Sequence[Scan], sonar_in_base: np.ndarray) -> EchoFindings:
    """Return what the scans of a run tell of mounts, stamps and head. sonar_in_base: (2,) m."""
    pairs = ScanPairs(scans, sonar_in_base)
    if not pairs.tell or not _reports_positions(scans):
        return EchoFindings([], AS_TOLD)
    best, causes = _turned(pairs), []
    turn = pairs.evidence(best)
    told = turn.nats > _NATS and (best.is_over or abs(best.turn) > _TURN_TOLD)
    base = best if turn.nats > _NATS else AS_TOLD
    # Thrusters' distances may be off by a third, and the solver finds how far: that is no cause.
    base = pairs.best(around(base, "scale", np.arange(0.6, 1.65, 0.05)))
    if told:
        causes.append(Cause(_turn_text(best), turn.nats, turn=TURN_DEVIATION if best.is_over else abs(best.turn)))
    causes += _delayed(pairs, base)
    causes += [] if told else [*_shifted(pairs, base), *_slipped(pairs, base)]
    return EchoFindings(causes, best if told else AS_TOLD)


def _reports_positions(scans: Sequence[Scan]) -> bool:
    """Return whether the odometry knows more than the heading: without, scans do not lie on each other anyway."""
    return any(np.ptp(scan.track.poses[:, :2], axis=0).any() for scan in scans)


def _turned(pairs: ScanPairs) -> Hypothesis:
    angles = np.arange(-np.pi, np.pi, _COARSE)
    coarse = pairs.best(Hypothesis(turn=float(turn), is_over=over) for over in (False, True) for turn in angles)
    return pairs.best(around(coarse, "turn", coarse.turn + _FINE * np.arange(-4, 5)))


def _turn_text(found: Hypothesis) -> str:
    turn = (np.degrees(found.turn) + 180.0) % 360.0 - 180.0
    angle = f"turned by {turn:.0f} +- {np.degrees(TURN_DEVIATION):.0f} deg against tf"
    if not found.is_over:
        return f"the sonar is {angle}, or the odometry's direction of motion against the vehicle"
    side = (
        "the sonar is upside down, or its head turns the other way than its driver says, or the odometry counts z down"
    )
    return side if abs(turn) < np.degrees(_TURN_TOLD) else f"{side}; it is {angle} besides"


def _delayed(pairs: ScanPairs, base: Hypothesis) -> List[Cause]:
    found = pairs.best(around(base, "delay", np.arange(-12.0, 12.5, 1.0)))
    nats = pairs.evidence(found, base).nats
    if abs(found.delay) <= _DELAY_TOLD or nats < _NATS:
        return []
    side = "later" if found.delay > 0.0 else "earlier"
    text = f"beams were sent {abs(found.delay):.0f} s {side} than their stamps, by the odometry's clock"
    return [Cause(text, nats, metres=1.0)]


def _shifted(pairs: ScanPairs, base: Hypothesis) -> List[Cause]:
    """Return whether the sonar sits elsewhere than tf says."""
    steps = np.arange(-4.0, 4.1, 0.5)
    ahead = pairs.best(around(base, "ahead", steps))
    found = pairs.best(around(ahead, "aside", steps))
    size, nats = float(np.hypot(found.ahead, found.aside)), pairs.evidence(found, base).nats
    if size < _ARM_TOLD or nats < _ARM_NATS:
        return []
    text = f"the sonar sits {found.ahead:+.1f} m ahead and {found.aside:+.1f} m to the left of where tf says"
    return [Cause(text, nats, metres=size)]


def _slipped(pairs: ScanPairs, base: Hypothesis) -> List[Cause]:
    """Return whether the sonar's turn changed in mid-run."""
    turns = base.turn + _FINE * np.arange(-11, 12)
    table, times = np.array([pairs.distances(one) for one in around(base, "turn", turns)]), pairs.times
    common, best = table[int(table.mean(axis=1).argmin())], None
    for moment in np.unique(times[:, 1]):
        sides = times[:, 1] <= moment, times[:, 0] >= moment - 1.0
        if min(len(np.unique(times[side, 0])) for side in sides) < _ONE_SIDE:
            continue
        rows = [int(table[:, side].mean(axis=1).argmin()) for side in sides]
        nats = [evidence_of(common[side] - table[row, side], times[side, 0]).nats for row, side in zip(rows, sides)]
        slip = float(turns[rows[1]] - turns[rows[0]])
        if abs(slip) > _SLIP_TOLD and (best is None or sum(nats) > best.nats):
            best = _Slip(float(sum(nats)), float(moment), slip)
    if best is None or best.nats < _SLIP_NATS:
        return []
    text = f"the head slipped by about {abs(np.degrees(best.slip)):.0f} deg, or the compass stepped,"
    return [Cause(text, best.nats, best.moment, turn=abs(best.slip))]


@dataclass(frozen=True)
class _Slip:
    nats: float
    moment: float
    slip: float
