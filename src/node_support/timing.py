"""Time that keeps step with the wall clock, events that should have come by now, and stretches of time."""

import time
from collections import deque
from typing import Callable, Deque, List

import numpy as np

_CATCH_UP = 0.5  # s; a smaller delay is caught up by running faster than requested, a greater one shifts the schedule
_REMEMBERED = 6  # times: one that was lost among them does not change the median of their intervals
_LATE = 2.0  # usual intervals since the newest one: the next one may come late, but not by a whole interval


class Pace:
    """Waits until a simulated or recorded time is reached, at `factor` of its seconds per second of wall time.

    A machine that is too slow, or was stopped, does not make time run faster afterwards: the schedule is
    shifted, and the delay is counted in `lost`.
    """

    def __init__(
        self, factor: float, wait: Callable[[float], object], clock: Callable[[], float] = time.monotonic
    ) -> None:
        """`wait` sleeps for the given number of seconds, or less if the simulation ends."""
        self.lost = 0.0
        self._factor = factor
        self._wait = wait
        self._clock = clock
        self._start = clock()

    def wait_for(self, simulated: float) -> bool:
        """Wait for a simulated time [s since the start]; return whether it is so late that the schedule was shifted."""
        late = self._clock() - (self._start + simulated / self._factor)
        if late < 0.0:
            self._wait(-late)
        if late <= _CATCH_UP:
            return False
        self._start += late
        self.lost += late
        return True


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


def stretches(holds: np.ndarray) -> List[List[int]]:
    """Return where each run of what `holds` (n,) begins, and the number after its end."""
    return np.flatnonzero(np.diff(np.concatenate([[0], holds, [0]]).astype(int))).reshape(-1, 2).tolist()
