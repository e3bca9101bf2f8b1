"""Tells when a scanning head has been everywhere once."""

import math
from typing import Optional

from sonar_processing.projection import wrapped

_BOTH_ENDS = 2


class TurnCounter:
    """Counts beams until the head has turned full circle, or has reversed at both ends of a sector."""

    def __init__(self, scan_beams: int = 0) -> None:
        """`scan_beams`: beams that make a scan whatever the head does; 0: the head's angle tells."""
        self.beams = 0
        self._scan_beams = scan_beams
        self._last: Optional[float] = None
        self._last_step = 0.0
        self._swept = 0.0
        self._smallest_step = math.inf
        self._reversals = 0

    def add(self, angle: float) -> bool:
        """Add a beam at a head angle [rad]; return whether it completes the scan."""
        self.beams += 1
        if self._last is not None:
            self._turn(wrapped(angle - self._last))
        self._last = angle
        if self._scan_beams:
            return self.beams >= self._scan_beams
        is_full = math.isfinite(self._smallest_step) and self._full_turn_reached()
        return is_full or self._reversals >= _BOTH_ENDS

    def _full_turn_reached(self) -> bool:
        return abs(self._swept) + 1.5 * self._smallest_step >= 2.0 * math.pi

    def _turn(self, step: float) -> None:
        if step == 0.0:
            return
        if step * self._last_step < 0.0:
            self._reversals += 1
        self._last_step = step
        self._swept += step
        self._smallest_step = min(self._smallest_step, abs(step))
