"""How the head turns: how far since a scan began, when it has been everywhere, and which beams it lost."""

import bisect
from collections import Counter, deque
from enum import Enum
from typing import Deque, List, Optional

from node_support.geometry import FULL_TURN, wrapped
from sonar_processing.beams.beam import Beam, has_other_bins

_BOTH_ENDS = 2  # a head that reversed twice has swept its sector from end to end
_SETTLED = 5  # Equal steps after which the head's step is another, and none was lost
_EQUAL = 0.25  # Share by which equal steps differ: gradians rounded from degrees do by a seventh
_JUMP = 0.4  # rad: more than a head turns while a line is disturbed for half a second; it was sent elsewhere


class HeadTurn:
    """Follows head angles, in whichever direction they go; the usual step is the median, so lost beams do no harm."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
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

    def __init__(self, scan_beams: int) -> None:
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


class HeadEvent(Enum):
    """What can happen to a head; the values name counters."""

    LOST = "beams lost"
    STEP_CHANGED = "changes of the head's step"
    SECTOR_CHANGED = "changes of the head's sector"
    RANGE_CHANGED = "changes of the beams' length"


class HeadWatch:
    """Follows the beams of one head in the order in which they come; begins anew when time goes back."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        self._last: Optional[Beam] = None
        self._step = 0.0
        self._swept = 0.0
        self._unusual: Deque[float] = deque(maxlen=_SETTLED)
        self._ends: Deque[float] = deque(maxlen=2)

    def add(self, beam: Beam) -> "Counter[HeadEvent]":
        events: Counter[HeadEvent] = Counter()
        last, self._last = self._last, beam
        if last is None or beam.stamp_ns < last.stamp_ns:
            self.clear()
            self._last = beam
            return events
        if has_other_bins(beam, last):
            events[HeadEvent.RANGE_CHANGED] += 1
        self._turn(wrapped(beam.angle - last.angle), last.angle, events)
        return events

    def _turn(self, step: float, from_angle: float, events: "Counter[HeadEvent]") -> None:
        if step == 0.0:
            return
        jumped = abs(step) > _JUMP
        if jumped or step * self._swept < 0.0:
            events[HeadEvent.SECTOR_CHANGED] += self._sector_differs(from_angle)
            self._swept = 0.0
        if jumped:
            self._unusual.clear()
            return
        self._swept += step
        if self._is_beyond_a_turn and self._ends:
            events[HeadEvent.SECTOR_CHANGED] += 1
            self._ends.clear()
        self._compare(abs(step), events)

    @property
    def _is_beyond_a_turn(self) -> bool:
        """Whether the head has gone on over the place where it last turned back; one that swings stops before."""
        return abs(self._swept) > FULL_TURN + 2.0 * self._step

    def _sector_differs(self, angle: float) -> bool:
        """Return whether a sweep that ends at `angle` is none of the sector so far.

        That is one after whole turns, or one that ends elsewhere than the one before last, which went the same way.
        """
        known = len(self._ends) == self._ends.maxlen
        differs = known and abs(wrapped(angle - self._ends[0])) > 1.5 * self._step
        differs = differs or self._is_beyond_a_turn
        self._ends.append(angle)
        return differs

    def _compare(self, step: float, events: "Counter[HeadEvent]") -> None:
        if self._step == 0.0:
            self._step = step
        if _are_equal(step, self._step):
            events[HeadEvent.LOST] += sum(max(round(one / self._step) - 1, 0) for one in self._unusual)
            self._unusual.clear()
            return
        self._unusual.append(step)
        if len(self._unusual) == _SETTLED and all(_are_equal(one, step) for one in self._unusual):
            events[HeadEvent.STEP_CHANGED] += 1
            self._step = step
            self._unusual.clear()


def _are_equal(step: float, other: float) -> bool:
    return abs(step - other) <= _EQUAL * max(step, other)
