"""Keeps simulated or recorded time in step with the wall clock."""

import time
from typing import Callable

# s; a smaller delay is caught up by running faster than requested, a greater one shifts the schedule.
_CATCH_UP = 0.5


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

    def wait_for(self, simulated: float) -> float:
        """Wait for a simulated time [s since the start]; return how late it already was, s of wall time."""
        late = self._clock() - (self._start + simulated / self._factor)
        if late < 0.0:
            self._wait(-late)
            return 0.0
        if late > _CATCH_UP:
            self._start += late
            self.lost += late
        return late
