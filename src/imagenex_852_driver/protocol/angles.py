"""Head positions (0.15 deg each, clockwise, 1400 ahead) to angles of the `sonar` frame and back."""

import math

AHEAD = 1400  # Head position straight ahead (manufacturer's specification)

_RADIANS_PER_POSITION = math.radians(0.15)


def head_angle(head_position: int, inverted: bool = False) -> float:
    """Return the angle of the beam about +z from +x, counter-clockwise radians in [-pi, pi] (REP-103).

    `inverted` means a head mounted upside down: what it counts clockwise is then counter-clockwise.
    """
    clockwise = (head_position - AHEAD) * _RADIANS_PER_POSITION
    return math.remainder(clockwise if inverted else -clockwise, 2 * math.pi)


def head_position(angle: float, inverted: bool = False) -> int:
    """Return the position nearest to `angle`, among those within half a turn of straight ahead."""
    wrapped = math.remainder(angle, 2 * math.pi)
    return AHEAD + round((wrapped if inverted else -wrapped) / _RADIANS_PER_POSITION)
