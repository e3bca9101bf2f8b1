"""Whether a match says more than chance would, and more than the places beside it.

Clutter always finds something of a map to lie on, and two long walls match wherever the scan lies along them: what
decides then is a handful of points.
"""

from typing import Callable

import numpy as np

# Other places: with 48 the standard deviation of their shares is known to a tenth.
_PLACES = 48
# m: beyond what a wall is thick, within what a scan sees.
_SHIFT = 8.0
# Of a share of 150 echoes: three of them.
_LEAST_DEVIATION = 0.02
# m: nearer places are the same fit; farther ones than 10 m no beam of a scan confuses.
_LEAST_SHIFT = 1.5
_GREATEST_SHIFT = 10.0
_SHIFT_STEP = 0.5
OfMoves = Callable[[np.ndarray], np.ndarray]
"""From moves (k, 3) of a fit's pose, x y [m] yaw [rad], to a value (k,) of each."""


def significance(matched_shares: OfMoves, seed: int = 0) -> float:
    """Return by how many standard deviations the matched share of a fit beats that of other places.

    The other places lie up to 8 m away with any heading.
    """
    rng = np.random.default_rng(seed)
    places = rng.uniform(-_SHIFT, _SHIFT, (_PLACES, 2))
    moves = np.column_stack([places, rng.uniform(-np.pi, np.pi, _PLACES)])
    shares = matched_shares(np.vstack([np.zeros(3), moves]))
    return float((shares[0] - shares[1:].mean()) / max(shares[1:].std(), _LEAST_DEVIATION))


def lead_along(gains: OfMoves, direction: np.ndarray, nearest: float) -> float:
    """Return by how much the gain of a fit beats that of the best place beside it; inf where none is beside.

    Those places lie `nearest`, but at least 1.5 m, to 10 m away, to both sides along `direction` (2,), a unit vector in
    map.
    """
    shifts = np.arange(_LEAST_SHIFT, _GREATEST_SHIFT + _SHIFT_STEP / 2.0, _SHIFT_STEP)
    shifts = shifts[shifts >= nearest]
    moves = np.outer(np.concatenate([[0.0], -shifts, shifts]), np.append(direction, 0.0))
    found = gains(moves)
    return float(found[0] - found[1:].max(initial=-np.inf))
