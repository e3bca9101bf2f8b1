"""What makes a map from above readable: its scale, and where north is."""

from typing import Optional

import numpy as np

from georeferencing.origin import Origin
from node_support.geometry import rotated

_STEPS = np.array([1.0, 2.0, 5.0])
_SHARE = 0.2  # of the map's width that a scale bar takes at most


def scale_bar(width: float) -> float:
    """Return the length [m], 1, 2 or 5 of a power of ten, of a bar for a map as wide as `width` > 0 [m]."""
    lengths = (_STEPS * 10.0 ** np.arange(-3, 6)[:, np.newaxis]).ravel()
    return float(lengths[lengths <= max(_SHARE * width, lengths[0])][-1])


def north(origin: Optional[Origin]) -> np.ndarray:
    """Return the unit vector (2,) in map that points north: y where nothing tells the azimuth (REP-103)."""
    return rotated(np.array([0.0, 1.0]), np.array(0.0 if origin is None else -origin.yaw))
