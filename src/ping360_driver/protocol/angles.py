"""Head angles in gradians (0.9 deg, clockwise, 200 ahead) to angles of the `sonar` frame and back.

The ping protocol counts gradians from 0 to 399. Ping Viewer, the manufacturer's program, shows 200 ahead and turns
clockwise, as seen from above when the transducer is on top.
"""

import math

TURN = 400
AHEAD = 200

_RADIANS_PER_GRADIAN = 2 * math.pi / TURN


def head_angle(gradians: int, inverted: bool = False) -> float:
    """Return the angle of the beam about +z from +x, counter-clockwise radians in [-pi, pi] (REP-103).

    `inverted` means a head whose transducer points down: what it counts clockwise is then counter-clockwise.
    """
    clockwise = (gradians - AHEAD) * _RADIANS_PER_GRADIAN
    return math.remainder(clockwise if inverted else -clockwise, 2 * math.pi)


def gradians(degrees: float) -> int:
    """Return the whole number of gradians nearest to an angle in degrees."""
    return round(degrees * TURN / 360)
