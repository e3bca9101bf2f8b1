"""What a check found."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Verdict:
    """One figure against its limit.

    name: of the check. value: what was found; NaN where the run is too short to tell. limit: above it (below it where
    `more_is_better`) the check fires. text: what the figure means, one line. doubtful: (k, 2) s, beginnings and ends
    of the stretches that made it fire. question: what the check looks at, for people who do not know the solver.
    """

    name: str
    value: float
    limit: float
    text: str
    more_is_better: bool = False
    doubtful: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))
    question: str = ""

    @property
    def fires(self) -> bool:
        """Whether the run is not to be trusted in this respect."""
        if np.isnan(self.value):
            return False
        return self.value < self.limit if self.more_is_better else self.value > self.limit

    def line(self) -> str:
        """Return the verdict as one line."""
        if np.isnan(self.value):
            return f"{self.name}: too little to tell"
        bound = "at least" if self.more_is_better else "at most"
        state = "DOUBTFUL" if self.fires else "fine"
        return f"{self.name}: {state}, {self.value:.2f}, must be {bound} {self.limit:g} ({self.text})"


def merged(starts: np.ndarray, length: float) -> np.ndarray:
    """Return stretches (k, 2) [s] that cover windows of `length` [s] from increasing `starts` (n,) on."""
    if not len(starts):
        return np.empty((0, 2))
    breaks = np.flatnonzero(np.diff(starts) > length)
    first, last = np.append(0, breaks + 1), np.append(breaks, len(starts) - 1)
    return np.column_stack([starts[first], starts[last] + length])
