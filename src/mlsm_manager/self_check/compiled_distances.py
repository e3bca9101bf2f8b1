"""The compiled search for how far the echoes of one scan lie from those of another.

It is compiled, or read from the cache on disk, when this module is imported: never while a scan waits.
"""

import numpy as np
from numba import float64

from node_support.numba_cache import compiled

_PLACES = float64[:, ::1]


def along_x(places: np.ndarray) -> np.ndarray:
    """Return places (n, 2) [m] as `mean_distance` searches them: in the order of x."""
    return np.ascontiguousarray(places[np.argsort(places[:, 0])])


@compiled(float64(_PLACES, _PLACES, float64))
def mean_distance(targets, places, most):
    """Return how far [m] `places` (n, 2) lie in the mean from the nearest of `targets` (m, 2), in the order of x.

    A place that is farther than `most` [m] from all counts as that far. n must not be 0.
    """
    total = 0.0
    for place in range(len(places)):
        x, y, nearest = places[place, 0], places[place, 1], most * most
        middle = np.searchsorted(targets[:, 0], x)
        for step, first, end in ((1, middle, len(targets)), (-1, middle - 1, -1)):
            for target in range(first, end, step):
                along = (targets[target, 0] - x) ** 2
                if along >= nearest:
                    break
                nearest = min(nearest, along + (targets[target, 1] - y) ** 2)
        total += np.sqrt(nearest)
    return total / len(places)
