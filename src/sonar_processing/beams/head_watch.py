"""Watches the angles and ranges of a head: lost beams, and changes of step, sector and range while it runs."""

from collections import Counter, deque
from enum import Enum
from typing import Deque, Optional

from node_support.geometry import FULL_TURN, wrapped
from sonar_processing.beams.beam import Beam

_SETTLED = 5  # Equal steps after which the head's step is another, and none was lost
_EQUAL = 0.25  # Share by which equal steps differ: gradians rounded from degrees do by a seventh
_JUMP = 0.4  # rad: more than a head turns while a line is disturbed for half a second; it was sent elsewhere


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
        """Begin anew with the next beam."""
        self._last: Optional[Beam] = None
        self._step = 0.0
        self._swept = 0.0
        self._unusual: Deque[float] = deque(maxlen=_SETTLED)
        self._ends: Deque[float] = deque(maxlen=2)

    def add(self, beam: Beam) -> "Counter[HeadEvent]":
        """Add a beam and return what happened, how often."""
        events: Counter[HeadEvent] = Counter()
        last, self._last = self._last, beam
        if last is None or beam.stamp_ns < last.stamp_ns:
            self.clear()
            self._last = beam
            return events
        if (beam.intensities.size, beam.range_resolution) != (last.intensities.size, last.range_resolution):
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
            events[HeadEvent.LOST] += sum(_lost(one, self._step) for one in self._unusual)
            self._unusual.clear()
            return
        self._unusual.append(step)
        if len(self._unusual) == _SETTLED and all(_are_equal(one, step) for one in self._unusual):
            events[HeadEvent.STEP_CHANGED] += 1
            self._step = step
            self._unusual.clear()


def _are_equal(step: float, other: float) -> bool:
    return abs(step - other) <= _EQUAL * max(step, other)


def _lost(step: float, usual: float) -> int:
    return max(round(step / usual) - 1, 0)
