"""Whether a match says more than chance would: clutter always finds something of a map to lie on."""

from typing import Callable

import numpy as np

from mlsm_manager.matching.planar_motion import STATES

_PLACES = 48
_SHIFT = 8.0
_LEAST_DEVIATION = 0.02


def significance(matched: Callable[[np.ndarray], np.ndarray], theta: np.ndarray, seed: int = 0) -> float:
    """Return by how many standard deviations the matched share at `theta` (8,) beats that of other places.

    `matched` returns (n,) bool for a state. The other places lie up to 8 m away with any heading.
    """
    rng = np.random.default_rng(seed)
    elsewhere = np.zeros((_PLACES, STATES))
    elsewhere[:, :2] = rng.uniform(-_SHIFT, _SHIFT, (_PLACES, 2))
    elsewhere[:, 2] = rng.uniform(-np.pi, np.pi, _PLACES)
    shares = np.array([matched(theta + place).mean() for place in elsewhere])
    return float((matched(theta).mean() - shares.mean()) / max(shares.std(), _LEAST_DEVIATION))
