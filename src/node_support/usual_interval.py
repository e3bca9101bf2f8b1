"""Notices that something that comes regularly does not come any more."""

from collections import deque
from typing import Deque

import numpy as np

_REMEMBERED = 6  # times: one that was lost among them does not change the median of their intervals
_LATE = 2.0  # usual intervals since the newest one: the next one may come late, but not by a whole interval


class UsualInterval:
    """Knows from the newest times of an event when its next one should have come at the latest."""

    def __init__(self) -> None:
        self._times: Deque[float] = deque(maxlen=_REMEMBERED)
        self._due = np.inf

    def take(self, time: float) -> None:
        """Learn that it came at `time` [s]; a time that is not newer than the last says nothing."""
        if self._times and time <= self._times[-1]:
            return
        self._times.append(time)
        if len(self._times) > 1:
            self._due = time + _LATE * float(np.median(np.diff(self._times)))

    def overdue(self, time: float) -> float:
        """Return by how many seconds it is overdue at `time` [s]; 0 until it came twice."""
        return max(time - self._due, 0.0)
