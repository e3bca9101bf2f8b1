"""Tells when a scanning head has been everywhere once."""

from sonar_processing.scans.head_turn import HeadTurn

_BOTH_ENDS = 2


class TurnCounter:
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
