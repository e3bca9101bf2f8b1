"""The unit in which a message gives the angle of the head."""

import math
from collections import deque
from enum import Enum
from typing import Deque, Optional

_VOTES = 25  # Beams that are looked back on: more than the seven that gradians spend below 2 pi in a turn
_ROUNDING = 1e-3  # Of a float32 that holds an angle


class AngleUnit(Enum):
    """A unit of angles."""

    RADIANS = "RADIANS"
    DEGREES = "DEGREES"
    GRADIANS = "GRADIANS"

    def to_radians(self, angle: float) -> float:
        """Return an angle of this unit in rad."""
        return angle * _RADIANS[self]


_RADIANS = {AngleUnit.RADIANS: 1.0, AngleUnit.DEGREES: math.pi / 180.0, AngleUnit.GRADIANS: math.pi / 200.0}


class RadiansOrGradians:
    """Tells by the values whether a driver sends gradians where radians are documented.

    A value beyond a turn of radians, or a whole number, speaks for gradians: heads count their steps in them, and no
    step but 0 is a whole number of radians. Any other value speaks for radians. The majority of the newest 25 decides,
    so that one broken message does not.
    """

    def __init__(self) -> None:
        self._votes: Deque[bool] = deque(maxlen=_VOTES)
        self.unit: Optional[AngleUnit] = None
        """None before any angle said something."""

    def take(self, angle: float) -> None:
        """Take one more angle; one that is 0 or not finite says nothing."""
        if math.isfinite(angle) and angle != 0.0:
            self._votes.append(angle == round(angle) or abs(angle) > 2.0 * math.pi + _ROUNDING)
            for_gradians = sum(self._votes)
            if 2 * for_gradians != len(self._votes):
                is_gradians = 2 * for_gradians > len(self._votes)
                self.unit = AngleUnit.GRADIANS if is_gradians else AngleUnit.RADIANS
