"""Collects the beams of whole turns (or sweeps of a sector) for those who need the polar scan."""

from collections import deque
from typing import Deque, List, Optional

from sonar_processing.beams.beam import Beam
from sonar_processing.beams.pause import long_after
from sonar_processing.beams.placed_beam import PlacedBeam, servo_moved
from sonar_processing.scans.head_turn import HeadTurn

MOST_BEAMS = 3600  # Beams of 0.1 deg, finer than any head steps; a head that stands still must not fill the memory


class RevolutionCollector:
    """Holds the beams of the unfinished turn, whatever a scan is; at most the newest `MOST_BEAMS`."""

    def __init__(self) -> None:
        self._beams: Deque[PlacedBeam] = deque(maxlen=MOST_BEAMS)
        self._turn = HeadTurn()

    def __len__(self) -> int:
        """Return how many beams the unfinished turn holds."""
        return len(self._beams)

    def clear(self) -> None:
        """Forget the unfinished turn."""
        self._beams.clear()
        self._turn.clear()

    def add(self, placed: PlacedBeam) -> Optional[List[PlacedBeam]]:
        """Add a beam; return the beams of the turn or sweep that it completes, or None.

        All beams of a turn have the same bins. A turn in which the servo or the range of the sonar changed, or the head
        was silent for long, is forgotten; a sweep ends where the head goes back.
        """
        beam, finished = placed.beam, None
        if self._beams and _differs(beam, self._beams[-1].beam):
            self.clear()
        elif self._turn.would_pass_start(beam.angle) or self._turn.would_reverse(beam.angle):
            finished = self._finish()
        self._beams.append(placed)
        self._turn.add(beam.angle)
        if finished is None and self._turn.is_full:
            finished = self._finish()
        return finished

    def _finish(self) -> List[PlacedBeam]:
        beams = list(self._beams)
        self.clear()
        return beams


def _differs(beam: Beam, earlier: Beam) -> bool:
    return (
        servo_moved(beam, earlier)
        or long_after(beam, earlier)
        or beam.intensities.size != earlier.intensities.size
        or beam.range_resolution != earlier.range_resolution
        or beam.frame_id != earlier.frame_id
    )
