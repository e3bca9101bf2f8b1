"""Headings of compasses that publish a single number."""

import math

import numpy as np

from dead_reckoning.parameters import HeadingType
from node_support.errors import RefusedInput

_MOST_TURNS = 2.0  # a compass counts to one turn; a driver that unwraps it counts on


def rotation_of_heading(heading: float, kind: HeadingType) -> np.ndarray:
    """Return R_odom_base (3, 3), x east and z up, of a level vehicle.

    heading: clockwise from north, in degrees or radians as `kind` says.
    Raises RefusedInput for a heading that is not finite, or of more than two turns.
    """
    radians = math.radians(heading) if kind is HeadingType.COMPASS_DEGREES else heading
    if not abs(radians) <= _MOST_TURNS * 2.0 * math.pi:
        unit = "deg" if kind is HeadingType.COMPASS_DEGREES else "rad"
        raise RefusedInput(
            "headings refused", f"{heading} {unit}, must be finite and at most two turns; see heading_type"
        )
    yaw = math.pi / 2.0 - radians
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
