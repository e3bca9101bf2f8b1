"""How far a run can be trusted: what contradicts, what was not measured, and how well the position is known."""

from dataclasses import dataclass, replace
from typing import Any, Dict, List, NamedTuple, Optional, Sequence

import numpy as np

from mlsm_manager.report.mission import Uncertainty
from mlsm_manager.self_check.causes import NOTHING_ASSUMED, Assumption, Cause, widened
from mlsm_manager.self_check.path_checks import per_minute
from mlsm_manager.self_check.verdict import FEWEST_MATCHED, Answer, RunAnswer, Verdict, too_few

WITHIN = float(np.sqrt(-2.0 * np.log(0.05) / 2.0))  # radius that holds 95 %, over the root of both variances' sum

_MATTERS = 1.2  # times as large a deviation: less is not worth a doubt


@dataclass(frozen=True)
class Trust:
    """verdicts: of all checks. times: (k,) s. covariances: (k, 2, 2) m^2 of the position in map, as stated then.

    matched: scans that were compared with the surfaces of others. causes: of what is wrong, ranked. assumed: what
    nobody measured and the path rests on, if anything. if_so: m, the largest deviation if that is so; NaN where nothing
    tells. untold: a clause of what no check of such a run can tell; empty where there is nothing such.
    """

    verdicts: List[Verdict]
    times: np.ndarray
    covariances: np.ndarray
    matched: int
    causes: Sequence[Cause] = ()
    assumed: Assumption = NOTHING_ASSUMED
    if_so: float = np.nan
    untold: str = ""

    def assuming(self, assumed: Assumption, places: np.ndarray) -> "Trust":
        """Return that of a path that rests on what nobody measured: no check is fine, and it lies elsewhere if not so.

        places: (k, 2) m, the path. Lengths with which it lies hardly elsewhere are not told.
        """
        verdicts = [verdict.assuming(assumed.text) for verdict in self.verdicts]
        held = replace(self, verdicts=verdicts, assumed=assumed)
        if np.isnan(assumed.turn):
            return held
        if_not = replace(self, covariances=widened(self.covariances, self.times, places, [assumed.if_not]))
        if_so = float(self.deviations.max())
        if assumed.length and if_not.deviations.max() < _MATTERS * if_so:
            return if_not
        return replace(held, covariances=if_not.covariances, if_so=if_so)

    @property
    def answer(self) -> RunAnswer:
        """How the run came out; what is mended is wrong no more."""
        answers = {verdict.answer for verdict in self.verdicts}
        if Answer.DOUBTFUL in answers or any(not cause.is_mended for cause in self.causes):
            return RunAnswer.DOUBTFUL
        if Answer.FINE not in answers or too_few(self.matched):
            return RunAnswer.UNMEASURED
        return RunAnswer.FINE if answers == {Answer.FINE} else RunAnswer.PARTLY

    @property
    def line(self) -> str:
        return "; ".join(filter(None, [self._answered, self.untold]))

    @property
    def _answered(self) -> str:
        begin = float(self.times[0])
        fine, doubtful, missing = ([one for one in self.verdicts if one.answer is answer] for answer in Answer)
        mended = "".join(f"; mended: {cause.line(begin)}" for cause in self.causes if cause.is_mended)
        if self.answer is RunAnswer.DOUBTFUL:
            wrong = [cause.line(begin) for cause in self.causes if not cause.is_mended]
            said = "; ".join([*wrong, *(one.text for one in doubtful)])
            known = self._known_if(self.assumed.text) if self.assumed.text else self._known
            return f"trust: DOUBTFUL: {said}{mended}; {f'at best {known}' if self._is_told else _NOTHING}"
        if self.answer is RunAnswer.UNMEASURED:
            return f"trust: NOT MEASURED: {self._not_measured}{mended}"
        if self.answer is RunAnswer.PARTLY:
            names = ", ".join(one.name for one in missing)
            told = f"{len(fine)} of {len(self.verdicts)} checks are fine, NOT MEASURED: {names}"
            return f"trust: {told}; {self._known} if these are fine too{mended}"
        return f"trust: all {len(self.verdicts)} checks are fine, nothing contradicts: {self._known}{mended}"

    @property
    def _known(self) -> str:
        """How well the position is known."""
        return f"position {_within(float(self.deviations.max()))}"

    def _known_if(self, assumed: str) -> str:
        """Return how well the position is known if what is assumed is so, and if not; assumed: that in words."""
        if_not = float(self.deviations.max())
        if_so = if_not if np.isnan(self.if_so) else self.if_so
        otherwise = f", {_within(if_not)} if not" if if_not > if_so else ""
        return f"position {_within(if_so)} if {assumed}{otherwise}"

    @property
    def _not_measured(self) -> str:
        reasons = "; ".join(filter(None, [too_few(self.matched), self.assumed.text]))
        reason = reasons or f"none of {len(self.verdicts)} checks had enough data"
        if not self._is_told:
            return f"{reason}; {_NOTHING}"
        if not self.assumed.text:
            return f"{reason}; {self._known} if there are none"
        return f"{reason}; {self._known_if('so')}"

    @property
    def _is_told(self) -> bool:
        """Whether the checks say anything of the position."""
        answers = {verdict.answer for verdict in self.verdicts}
        assumed = not np.isnan(self.if_so) and any(one.text == self.assumed.text for one in self.verdicts)
        is_fine = Answer.FINE in answers or assumed
        return Answer.DOUBTFUL in answers or (is_fine and self.matched >= FEWEST_MATCHED)

    @property
    def deviations(self) -> np.ndarray:
        """(k,) m, 2-D standard deviations of the position in map, as stated at `times`."""
        return radii(self.covariances)

    @property
    def uncertainty(self) -> Optional[Uncertainty]:
        """What picture and report show of it; None where nothing can be said of the position."""
        return Uncertainty(self.times, self.covariances, self.doubtful) if self._is_told else None

    @property
    def doubtful(self) -> np.ndarray:
        """(k, 2) s, beginnings and ends of the stretches that made a check fire."""
        return np.concatenate([np.empty((0, 2)), *(v.doubtful for v in self.verdicts if v.fires)])

    def to_mapping(self) -> Dict[str, Any]:
        """Return the checks and the deviation per minute for summary.json."""
        checks = {
            verdict.name: {
                "value": None if np.isnan(verdict.value) else round(verdict.value, 3),
                "limit": verdict.limit,
                "fires": verdict.fires,
                "answer": verdict.answer.value,
                "meaning": verdict.text,
            }
            for verdict in self.verdicts
        }
        minutes = per_minute(self.times, self.deviations)
        told = np.isfinite(minutes) & (self.uncertainty is not None)
        stated = [round(float(value), 2) if known else None for value, known in zip(minutes, told)]
        causes = [cause.to_mapping(float(self.times[0])) for cause in self.causes]
        return {
            "answer": self.answer.value, "causes": causes, "checks": checks, "deviation_per_minute": stated,
        }  # fmt: skip


_NOTHING = "nothing can be said of the position"


def _within(deviation: float) -> str:
    return f"within {WITHIN * deviation:.1f} m"


class KnownPlaces(NamedTuple):
    """Where a vehicle was by one run. times: (k,) s. places: (k, 2) m in map. covariances: (k, 2, 2) m^2."""

    times: np.ndarray
    places: np.ndarray
    covariances: np.ndarray

    def or_on(self, other: "KnownPlaces") -> "KnownPlaces":
        """Return these places, as uncertain as where the vehicle may as well have gone the other way, if that is more.

        other: at any times.
        """
        columns = np.column_stack([other.places, other.covariances.reshape(-1, 4)])
        there = np.stack([np.interp(self.times, other.times, column) for column in columns.T], axis=-1)
        apart, of_other = there[:, :2] - self.places, there[:, 2:].reshape(-1, 2, 2)
        if_other = of_other + apart[:, :, np.newaxis] * apart[:, np.newaxis]
        is_more = radii(if_other) > radii(self.covariances)
        return self._replace(covariances=np.where(is_more[:, np.newaxis, np.newaxis], if_other, self.covariances))


def radii(covariances: np.ndarray) -> np.ndarray:
    """Return (k,) m, the roots of the sums of both variances (k, 2, 2)."""
    return np.sqrt(np.trace(covariances, axis1=1, axis2=2))
