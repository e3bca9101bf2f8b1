"""Whether a match says more than chance would, and more than the places beside it.

Clutter always finds something of a map to lie on, and two long walls match wherever the scan lies along them: what
decides then is a handful of points.
"""

from typing import Callable

import numpy as np

from mlsm_manager.matching.planar_motion import STATES

_PLACES = 48
_SHIFT = 8.0
_LEAST_DEVIATION = 0.02
_LEAST_SHIFT = 1.5
_GREATEST_SHIFT = 10.0
_SHIFT_STEP = 0.5
Matched = Callable[[np.ndarray], np.ndarray]
"""From a state (8,) to which points (n,) bool lie on the map."""


def significance(matched: Matched, theta: np.ndarray, seed: int = 0) -> float:
    """Return by how many standard deviations the matched share at `theta` (8,) beats that of other places.

    The other places lie up to 8 m away with any heading.
    """
    rng = np.random.default_rng(seed)
    elsewhere = np.zeros((_PLACES, STATES))
    elsewhere[:, :2] = rng.uniform(-_SHIFT, _SHIFT, (_PLACES, 2))
    elsewhere[:, 2] = rng.uniform(-np.pi, np.pi, _PLACES)
    shares = np.array([matched(theta + place).mean() for place in elsewhere])
    return float((matched(theta).mean() - shares.mean()) / max(shares.std(), _LEAST_DEVIATION))


def lead_along(gain: Callable[[np.ndarray], float], theta: np.ndarray, direction: np.ndarray, nearest: float) -> float:
    """Return by how much the gain at `theta` (8,) beats that of the best place beside it; inf where none is beside.

    Those places lie `nearest`, but at least 1.5 m, to 10 m away, to both sides along `direction` (2,), a unit vector in
    map.
    """
    shifts = np.arange(_LEAST_SHIFT, _GREATEST_SHIFT + _SHIFT_STEP / 2.0, _SHIFT_STEP)
    shifts = shifts[shifts >= nearest]
    beside = np.tile(theta, (2 * len(shifts), 1))
    beside[:, :2] += np.concatenate([-shifts, shifts])[:, np.newaxis] * direction
    return gain(theta) - max((gain(state) for state in beside), default=-np.inf)
