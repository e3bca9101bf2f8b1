"""What is wrong with a run, when and by how much; the evidence ranks several."""

from dataclasses import dataclass
from typing import Any, Dict, Iterable, List, NamedTuple, Optional, Sequence, Union

import numpy as np

from mlsm_manager.joint_solver.sonar_trials import SonarFault, SonarKind
from mlsm_manager.odometry.faults import TURNED, FaultKind, MotionFault
from mlsm_manager.odometry.steps import Step, StepKind
from mlsm_manager.self_check.verdict import moment

CERTAIN = 1e3  # nats: of what needs no echo to be seen
NAMED_FROM = float(np.log(100.0 / 0.05))
"""Nats from which on a cause is named: one in a hundred runs has it, and 95 % are asked for."""
_FEW = 3  # steps that are told one by one
_SPEED_CHANGE, _TURN_RATE = 0.15, 0.05  # m/s, rad/s: by which a small vehicle changes its motion while it works
_LEFT = 0.5  # m: by which the vehicle may move while its odometry jumps, besides what it did just before
_AGAIN = (FaultKind.STUCK, *TURNED)

Fault = Union[MotionFault, SonarFault]


def is_same(one: Optional[Fault], other: Fault) -> bool:
    """Return whether two faults are one: of most kinds a run has one only, but a compass may stick or step again."""
    return one is not None and one.kind is other.kind and (one.kind not in _AGAIN or one.begin == other.begin)


@dataclass(frozen=True)
class Cause:
    """Something that is wrong with sonar, odometry or mounting.

    text: what and how much, one clause. evidence: nats over "nothing is wrong". begin: s, when it began; NaN where it
    holds for the whole run. is_mended: whether the run went on without it.
    turn: rad, length: relative, metres: by how much the path from `begin` on may be turned, too long, and shifted.
    fault: which a fit may mend; None where none can. Of what was mended it is that if it was mended wrongly.
    """

    text: str
    evidence: float
    begin: float = np.nan
    is_mended: bool = False
    turn: float = 0.0
    length: float = 0.0
    metres: float = 0.0
    fault: Optional[Fault] = None

    @property
    def kind(self) -> Union[FaultKind, SonarKind, None]:
        """That of the fault; None without one."""
        return None if self.fault is None else self.fault.kind

    def to_mapping(self, run_begin: float) -> Dict[str, Any]:
        """Return it for summary.json; run_begin: s."""
        second = None if np.isnan(self.begin) else round(self.begin - run_begin, 1)
        return {
            "cause": self.text, "second": second, "evidence": round(self.evidence, 1), "mended": self.is_mended
        }  # fmt: skip

    def line(self, run_begin: float) -> str:
        """Return it for people; run_begin: s."""
        return self.text if np.isnan(self.begin) else f"{self.text} at {moment(max(self.begin, run_begin), run_begin)}"


class Assumption(NamedTuple):
    """What nobody measured and the path rests on. text: one clause; empty where there is none.

    turn: rad, length: relative, by how much the path is turned and too long if it is not so; turn is NaN where nothing
    can be said of the position if it is.
    """

    text: str
    turn: float = np.nan
    length: float = 0.0

    @property
    def if_not(self) -> Cause:
        """What is wrong if it is not so."""
        return Cause(self.text, CERTAIN, turn=self.turn, length=self.length)


NOTHING_ASSUMED = Assumption("")
UNTOLD_ALONE = "with a compass alone nothing tells whether all headings or all ranges are off alike"


def ranked(causes: Iterable[Cause]) -> List[Cause]:
    """Return causes, those with most evidence first; what was mended comes last."""
    return sorted(causes, key=lambda cause: (cause.is_mended, -cause.evidence))


def of_steps(steps: Sequence[Step]) -> List[Cause]:
    """Return a cause for each of a few steps of a kind, and one for all of many; all were left out."""
    causes: List[Cause] = []
    for kind in StepKind:
        of_kind = [step for step in steps if step.kind is kind]
        groups = [[step] for step in of_kind] if len(of_kind) <= _FEW else [of_kind]
        causes += map(_of_step, groups)
    return causes


def unsure_length(size: float) -> float:
    """Return by how much the length of a path is unsure, relative, that may as well be exp(-size) times as long."""
    return float(np.abs(np.expm1(-size)) / np.sqrt(2.0))


def of_stuck(begin: float, end: float) -> Cause:
    """Return the cause for a heading that stood from `begin` to `end` [s] while the vehicle went on."""
    fault = MotionFault(FaultKind.STUCK, begin, (0.0,), end)
    return Cause(f"the compass stuck for {end - begin:.0f} s", CERTAIN, begin, turn=np.pi / 2.0, fault=fault)


def _of_step(steps: List[Step]) -> Cause:
    """Return the cause for one step, or for many of a kind.

    An odometry that keeps stalling is not mended, nor one that hangs while the vehicle may do anything.
    """
    most, lost = max(steps, key=lambda step: (step.size, abs(step.turn))), [step.lost for step in steps]
    text = most.text if len(steps) == 1 else f"{most.text} at most, {len(steps)} times, first"
    is_mended = not any(lost) or (len(steps) == 1 and not most.is_too_long)
    seconds = float(np.linalg.norm(lost))
    turn = 0.0 if most.kind in (StepKind.POSITIONS, StepKind.HUNG) else _TURN_RATE * seconds
    metres = float(np.hypot(_LEFT * np.sqrt(len(steps)), _SPEED_CHANGE * seconds))
    misread = most.misread if len(steps) == 1 else None
    return Cause(text, CERTAIN + most.size, steps[0].begin, is_mended, turn, metres=metres, fault=misread)


def widened(
    covariances: np.ndarray, times: np.ndarray, places: np.ndarray, causes: Sequence[Cause]
) -> np.ndarray:  # fmt: skip
    """Return covariances (k, 2, 2) [m^2] of places (k, 2) [m] at `times` (k,) [s] with what causes add to them."""
    added = np.zeros(len(times))
    for cause in causes:
        # A fit of the whole run bends what was before a cause, too, where the cause was not mended.
        begin = cause.begin if cause.is_mended and not np.isnan(cause.begin) else times[0]
        start = [np.interp(begin, times, places[:, axis]) for axis in (0, 1)]
        way = np.hypot(*(places - start).T) * np.hypot(2.0 * np.sin(min(cause.turn, np.pi) / 2.0), cause.length)
        added += np.where(times >= begin, way**2 + cause.metres**2, 0.0) / 2.0
    return covariances + added[:, np.newaxis, np.newaxis] * np.eye(2)
