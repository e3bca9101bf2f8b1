"""What a check found."""

from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from enum import Enum

import numpy as np

from node_support.errors import counted

FEWEST_MATCHED = 3  # scans: two tell how they lie to each other, a third one whether that holds
FEWEST_CHECKED = 7  # scans: six show how alike scans of this water are, a seventh whether what they tell holds
_RECORDED, _LATEST = 1e9, 2.0**31  # s since 1970 of clocks that tell the time: simulated ones begin near 0


def too_few(matched: int) -> str:
    """Return that so many matched scans do not show faults yet; empty where they are enough."""
    if matched >= FEWEST_CHECKED:
        return ""
    return f"{counted(matched, 'scan')} matched, faults show from {FEWEST_CHECKED} scans on"


class Answer(Enum):
    """What a check says. A check without enough data is not fine."""

    FINE = "fine"
    DOUBTFUL = "DOUBTFUL"
    NOT_MEASURED = "not measured"


class RunAnswer(Enum):
    """How a run came out by all its checks."""

    FINE = "all checks fine"
    PARTLY = "partly measured"
    UNMEASURED = "not measured"
    DOUBTFUL = "doubtful"


@dataclass(frozen=True)
class Verdict:
    """One figure against its limit.

    name: of the check. value: what was found; NaN where the run is too short to tell. limit: above it (below it where
    `more_is_better`) the check fires. text: what that means, one clause, the figures last; with NaN what is missing.
    doubtful: (k, 2) s, beginnings and ends of the stretches that made it fire. question: what the check looks at, for
    people who do not know the solver.
    """

    name: str
    value: float
    limit: float
    text: str
    more_is_better: bool = False
    doubtful: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))
    question: str = ""

    @property
    def answer(self) -> Answer:
        """What the check says."""
        if np.isnan(self.value):
            return Answer.NOT_MEASURED
        beyond = self.value < self.limit if self.more_is_better else self.value > self.limit
        return Answer.DOUBTFUL if beyond else Answer.FINE

    @property
    def fires(self) -> bool:
        """Whether the run is not to be trusted in this respect."""
        return self.answer is Answer.DOUBTFUL

    def assuming(self, assumed: str) -> "Verdict":
        """Return the verdict of a run whose path rests on what nobody measured, if any: fine is then not measured."""
        if not assumed or self.answer is not Answer.FINE:
            return self
        return replace(self, value=np.nan, text=assumed)

    def line(self) -> str:
        """Return the verdict as one line."""
        return f"{self.answer.value}: {self.text}"


def merged(starts: np.ndarray, length: float) -> np.ndarray:
    """Return stretches (k, 2) [s] that cover windows of `length` [s] from increasing `starts` (n,) on."""
    if not len(starts):
        return np.empty((0, 2))
    breaks = np.flatnonzero(np.diff(starts) > length)
    first, last = np.append(0, breaks + 1), np.append(breaks, len(starts) - 1)
    return np.column_stack([starts[first], starts[last] + length])


def moment(time: float, begin: float) -> str:
    """Return when `time` [s] was: seconds after `begin` [s], and the clock's time unless that is simulated."""
    into = f"{time - begin:.0f} s"
    if not _RECORDED < time < _LATEST:
        return into
    return f"{into} ({datetime.fromtimestamp(time, timezone.utc):%H:%M:%S} UTC)"


def percent(share: float, digits: int = 0) -> str:
    """Return a share as people read it."""
    return f"{100.0 * share:.{digits}f} %"
