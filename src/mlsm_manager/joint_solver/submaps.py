"""Which scans are compared with each other: those after a silence wait apart until their place in the map is known."""

from typing import List

import numpy as np

from mlsm_manager.joint_solver.comparisons import Pairs
from mlsm_manager.joint_solver.placement import PlacedPoints

MAP = 0
"""The submap of all scans whose place in the map is known."""


class Submaps:
    """Every scan of a run has the number of its submap; a new one begins where nobody knows where the vehicle is."""

    def __init__(self, numbers: np.ndarray) -> None:
        """numbers: (n,) of the scans so far."""
        self._numbers: List[int] = [int(number) for number in numbers]
        self._begun = max(self._numbers, default=MAP)

    @property
    def numbers(self) -> np.ndarray:
        """(n,) int, the submap of each scan."""
        return np.array(self._numbers, dtype=np.int64)

    @property
    def newest(self) -> int:
        """The submap of the newest scan; that of the map where there is none."""
        return self._numbers[-1] if self._numbers else MAP

    @property
    def is_apart(self) -> bool:
        """Whether the place of the newest scan in the map is not known."""
        return self.newest != MAP

    @property
    def apart(self) -> np.ndarray:
        """(n,) bool, whether the place of a scan in the map is not known."""
        return self.numbers != MAP

    @property
    def start(self) -> int:
        """The first scan that the newest one is compared with."""
        return self._numbers.index(self.newest) if self.is_apart else 0

    def append(self) -> None:
        """Add a scan to the newest submap."""
        self._numbers.append(self.newest)

    def shorten(self, count: int) -> None:
        """Keep the oldest `count` scans."""
        del self._numbers[count:]

    def begin(self) -> None:
        """Let the newest scan begin a submap of its own."""
        self._begun += 1
        self._numbers[-1] = self._begun

    def join(self) -> None:
        """Put the newest submap into the map, because its place is known now."""
        joined = self.newest
        self._numbers = [MAP if number == joined else number for number in self._numbers]

    def within(self, pairs: Pairs, sources: PlacedPoints, targets: PlacedPoints) -> Pairs:
        """Return the comparisons of points of one submap; what was in the map before the run is of the map."""
        if not any(self._numbers):
            return pairs
        same = self._of(sources.scans[pairs.rows]) == self._of(targets.scans[pairs.neighbours])
        return Pairs(pairs.rows[same], pairs.neighbours[same], pairs.importance[same])

    def _of(self, scans: np.ndarray) -> np.ndarray:
        return np.where(scans < 0, MAP, self.numbers[scans])
