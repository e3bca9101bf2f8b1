"""Beams that wait until somebody knows where they were taken."""

import time
from collections import Counter, deque
from dataclasses import dataclass
from typing import Callable, Deque, Dict, List, Optional, Tuple

from sonar_processing.beams.beam import Beam

NEWER_BEAMS = 120  # One revolution of the usual head: tf may be late by a scan, not by more
PATIENCE = 20.0  # s of wall time: more than a busy machine lets a process stand still that tells tf something
_MEMORY = 10  # revolutions or messages of beams: nobody took them meanwhile, or they come faster than time allows


@dataclass(frozen=True)
class WaitingBeam:
    """A beam, whether the vehicle moved when it came, and when that was [s of the queue's clock]."""

    beam: Beam
    is_moving: bool
    since: float


class BeamQueue:
    """Holds beams in the order of their stamps.

    A beam that cannot be placed has waited too long once it has done so for `PATIENCE` seconds and `NEWER_BEAMS` beams
    or those of a whole message wait behind it. Neither of the two is enough: a recording may be played at many times
    its speed, and a slow head sends a beam a second. One that can be placed waits until older ones have been used.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """`clock` returns wall time, s."""
        self._clock = clock
        self._most = NEWER_BEAMS
        self._waiting: Deque[WaitingBeam] = deque()

    def __len__(self) -> int:
        return len(self._waiting)

    def make_room(self, beams: int) -> None:
        """Let so many beams wait that come at once: those of a whole turn in one message."""
        self._most = max(NEWER_BEAMS, 2 * beams)

    def clear(self) -> None:
        self._waiting.clear()

    def frames(self) -> Dict[str, int]:
        return Counter(entry.beam.frame_id for entry in self._waiting)

    def add(self, beam: Beam, is_moving: bool) -> Optional[WaitingBeam]:
        """Add the newest beam; return the oldest one where too many wait, which is then forgotten."""
        self._waiting.append(WaitingBeam(beam, is_moving, self._clock()))
        return self._waiting.popleft() if len(self._waiting) > _MEMORY * self._most else None

    def pop(self, obstacle: Callable[[Beam], str]) -> List[Tuple[WaitingBeam, str]]:
        """Return and forget the beams that need not wait any more, the oldest first, each with why it cannot be placed.

        These are all that can be placed now; those older than one of the same frame that can, since tf knows nothing
        more of the past; and those that have waited too long. `obstacle` says why a beam cannot be placed, or "".
        """
        stays: Deque[WaitingBeam] = deque()
        departing: Deque[WaitingBeam] = deque()
        placeable_frames = set()
        # From the newest back: what tf brings meanwhile can then only help the older ones.
        for entry in reversed(self._waiting):
            frame = entry.beam.frame_id
            if frame not in placeable_frames and not obstacle(entry.beam):
                placeable_frames.add(frame)
            (departing if frame in placeable_frames else stays).appendleft(entry)
        self._waiting = stays
        while len(stays) > self._most and self._clock() - stays[0].since > PATIENCE:
            departing.append(stays.popleft())
        return [(entry, obstacle(entry.beam)) for entry in departing]
