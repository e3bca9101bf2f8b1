"""Whether the vehicle moves, by the velocity that it reports (thesis 6.5.2, velocity topic)."""

import math
from typing import Optional, Sequence

from node_support.errors import RefusedInput
from sonar_processing.scans.parameters import SonarToCloudParameters


class MovingState:
    """The newest velocity, and how long ago it came in the time of the beams.

    Velocities have no stamp of their own (Twist), so a beam takes the newest one that came before it. A velocity that
    is not followed by another stays valid: a command may be sent once.
    """

    def __init__(self) -> None:
        self._speed = 0.0
        self._turn_rate = 0.0
        self._heard = False
        self._since_ns: Optional[int] = None

    def take(self, linear: Sequence[float], angular: Sequence[float]) -> None:
        """Take a velocity, m/s and rad/s. Raises RefusedInput when it is not finite; then the last one stays."""
        speed, turn_rate = _length(linear), _length(angular)
        if not (math.isfinite(speed) and math.isfinite(turn_rate)):
            raise RefusedInput("velocities refused", f"{tuple(linear)} m/s, {tuple(angular)} rad/s, must be finite")
        self._speed, self._turn_rate = speed, turn_rate
        self._heard, self._since_ns = True, None

    @property
    def was_heard(self) -> bool:
        """Whether any velocity has been received."""
        return self._heard

    def is_moving(self, parameters: SonarToCloudParameters) -> bool:
        """Whether the vehicle is faster than the dead band; without any velocity it is still."""
        return self._speed > parameters.still_speed or self._turn_rate > parameters.still_turn_rate

    def age(self, stamp_ns: int) -> float:
        """Return the seconds between the first beam after the newest velocity and a beam of `stamp_ns`.

        Counted from anew when time jumps back.
        """
        if self._since_ns is None or stamp_ns < self._since_ns:
            self._since_ns = stamp_ns
        return (stamp_ns - self._since_ns) * 1e-9


def _length(vector: Sequence[float]) -> float:
    return math.sqrt(sum(value * value for value in vector))
