"""How far the head has turned since the first beam of a scan, and when it has been everywhere."""

import bisect
from typing import List, Optional

from node_support.geometry import FULL_TURN, wrapped

_BOTH_ENDS = 2  # a head that reversed twice has swept its sector from end to end


class HeadTurn:
    """Follows head angles, in whichever direction they go; the usual step is the median, so lost beams do no harm."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Begin anew with the next beam."""
        self._last: Optional[float] = None
        self._swept = 0.0
        self._steps: List[float] = []

    def add(self, angle: float) -> None:
        """Turn to the next beam's head angle, rad."""
        step = self._step_to(angle)
        if step != 0.0:
            bisect.insort(self._steps, abs(step))
        self._swept += step
        self._last = angle

    @property
    def usual_step(self) -> float:
        """Median angle between beams that differ, rad; 0 before the head has moved."""
        return self._steps[len(self._steps) // 2] if self._steps else 0.0

    @property
    def is_full(self) -> bool:
        """Whether the next beam is expected where the turn began."""
        return bool(self._steps) and abs(self._swept) + 1.5 * self.usual_step >= FULL_TURN

    def would_pass_start(self, angle: float) -> bool:
        """Whether a beam at `angle` would lie where the turn began, or beyond: the last beams of the turn were lost."""
        return bool(self._steps) and abs(self._swept + self._step_to(angle)) + 0.5 * self.usual_step >= FULL_TURN

    def would_reverse(self, angle: float) -> bool:
        """Whether a beam at `angle` would lie back by half a step or more, as at the end of a sector."""
        step = self._step_to(angle)
        return step * self._swept < 0.0 and abs(step) >= 0.5 * self.usual_step

    def _step_to(self, angle: float) -> float:
        return 0.0 if self._last is None else wrapped(angle - self._last)


class SweepCounter:
    """Counts beams until the head has turned full circle, or has reversed at both ends of a sector."""

    def __init__(self, scan_beams: int = 0) -> None:
        """`scan_beams`: beams that make a scan whatever the head does; 0: the head's angle tells."""
        self.beams = 0
        self._scan_beams = scan_beams
        self._turn = HeadTurn()
        self._reversals = 0

    def add(self, angle: float) -> bool:
        """Add a beam at a head angle [rad]; return whether it completes the scan."""
        self.beams += 1
        if self._turn.would_reverse(angle):
            self._reversals += 1
            self._turn.clear()
        self._turn.add(angle)
        if self._scan_beams:
            return self.beams >= self._scan_beams
        return self._turn.is_full or self._reversals >= _BOTH_ENDS
