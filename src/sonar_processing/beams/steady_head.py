"""A head whose reported angles tremble: they go back and forth about a steady turn; at the end of a sector a head turns
back and goes on. Such angles are replaced by those of the turn.
"""

from collections import deque
from dataclasses import replace
from typing import Deque, List, NamedTuple, Optional, Sequence

import numpy as np

from node_support.geometry import wrapped
from sonar_processing.beams.beam import Beam, long_after

_SIDE = 30  # beams before and after one that tell its angle: fewer leave more of what trembles, more come later
_WINDOW = 2 * _SIDE + 1
_BACK = 0.5  # of a usual step: what else counts as the end of a sector
_FEWEST, _AMONG = 3, 300  # steps back among so many beams: fewer end no more than a scan in a turn
_LINE = 2.0  # times what trembles from beam to beam: by more angles do not lie beside a steady turn
_LONG = 6.0  # times what trembles: by less a head swings in a small sector
_SPREAD = 0.6745 * np.sqrt(6.0)  # median size of a + c - 2 b over the deviation of a, b and c


class Turning(NamedTuple):
    """How a head turned during a window of beams.

    angles: (_WINDOW,) rad, of a steady turn. deviation: rad, by which those reported tremble. is_steady: whether they
    lie beside it. goes_back: whether its middle beam is followed by one that lies back by half a usual step.
    """

    angles: np.ndarray
    deviation: float
    is_steady: bool
    goes_back: bool


def _turning(reported: Sequence[float]) -> Turning:
    """Return how a head turned that reported angles (_WINDOW,) [rad]."""
    angles, numbers = np.unwrap(reported), np.arange(-_SIDE, _SIDE + 1)
    steps = np.diff(angles)
    slope = float(angles @ numbers) / float(numbers @ numbers)
    line = angles.mean() + slope * numbers
    deviation = float(np.median(np.abs(np.diff(steps)))) / _SPREAD
    is_steady = float(np.std(angles - line)) <= _LINE * deviation <= _LINE * abs(slope) * _WINDOW / _LONG
    back = -float(steps[_SIDE] * np.sign(slope))
    return Turning(line, deviation, is_steady, is_steady and back >= _BACK * float(np.median(np.abs(steps))))


def _reverses(window: Sequence[float]) -> bool:
    """Return whether a head turned back at the middle of a window: only there angles need to be looked at."""
    before, angle, after = window[_SIDE - 1], window[_SIDE], window[_SIDE + 1]
    return wrapped(angle - before) * wrapped(after - angle) < 0.0


class SteadyHead:
    """Passes beams on at once, but those of a head that trembles `_SIDE` beams later, with the angles of its turn."""

    def __init__(self) -> None:
        self._steps_back: Deque[int] = deque(maxlen=_FEWEST)
        self._deviations: Deque[float] = deque(maxlen=_SIDE)
        self._count = 0
        self._clear()

    def _clear(self) -> None:
        self._window: Deque[float] = deque(maxlen=_WINDOW)
        self._held: Deque[Beam] = deque()

    def add(self, beam: Beam) -> List[Beam]:
        """Take the next beam; return those that may be used now. After a silence of the head it begins anew."""
        released: List[Beam] = []
        if self._held and (long_after(beam, self._held[-1]) or beam.stamp_ns < self._held[-1].stamp_ns):
            released = list(self._held)
            self._clear()
        self._count += 1
        self._window.append(beam.angle)
        self._held.append(beam)
        turning = self._look()
        if not self.trembles:
            released += self._held
            self._held.clear()
        elif len(self._held) > _SIDE:
            oldest = self._held.popleft()
            released.append(oldest if turning is None else _on(turning, oldest, _SIDE))
        return released

    @property
    def trembles(self) -> bool:
        """Whether angles went back several times of late."""
        return len(self._steps_back) == _FEWEST and self._count - self._steps_back[0] < _AMONG

    @property
    def deviation(self) -> float:
        """By which angles tremble, rad; 0 before they ever did."""
        return float(np.median(self._deviations)) if self._deviations else 0.0

    def _look(self) -> Optional[Turning]:
        if len(self._window) < _WINDOW or not (self.trembles or _reverses(self._window)):
            return None
        turning = _turning(self._window)
        if turning.goes_back:
            self._steps_back.append(self._count)
            self._deviations.append(turning.deviation)
        return turning


class Steadied(NamedTuple):
    """beams: with the angles of a steady turn. deviation: rad, by which those reported trembled.

    share: of the beams, whose head turned steadily; the others are as they were.
    """

    beams: List[Beam]
    deviation: float
    share: float


def steadied(beams: Sequence[Beam]) -> Optional[Steadied]:
    """Return the beams of a recording, in the order of their stamps, if their angles tremble; None where not."""
    angles = np.array([beam.angle for beam in beams])
    windows = [angles[first : first + _WINDOW] for first in range(len(angles) - _WINDOW + 1)]
    back = [turning for turning in map(_turning, filter(_reverses, windows)) if turning.goes_back]
    if len(back) < max(_FEWEST, _FEWEST * len(beams) / _AMONG):
        return None
    found, steady = [], 0
    for number, beam in enumerate(beams):
        first = min(max(number - _SIDE, 0), len(beams) - _WINDOW)
        turning = _turning(windows[first])
        found.append(_on(turning, beam, number - first))
        steady += turning.is_steady
    return Steadied(found, float(np.median([turning.deviation for turning in back])), steady / len(beams))


def _on(turning: Turning, beam: Beam, number: int) -> Beam:
    """Return a beam at a number in the window with the angle of the steady turn, where there is one."""
    return replace(beam, angle=float(wrapped(turning.angles[number]))) if turning.is_steady else beam
