"""Weighs how long a path is: along the way that is known least, longer and shorter ones fit nearly as well."""

import numpy as np

from mlsm_manager.joint_solver.shifting.shift_search import JudgedPath, ShiftSearch

_STRETCHES = np.linspace(-0.1, 0.1, 11)  # of the path; fits of basins agree about as well over a twentieth
_REFITS = 2  # the first undoes much of what a stretch does wrong


def stretched_mean(search: ShiftSearch, path: np.ndarray) -> JudgedPath:
    """Return the mean of the fits that begin at `path` (k, 2) [m] made longer and shorter, or `path` if it is better.

    Each fit counts as its echoes speak for it. A fit makes paths shorter, since echoes that lie closer together agree
    more often. The best fit is then at one end of those that agree about as well; the mean has the smaller error.
    """
    axis = search.least_known_axis()
    along = np.outer((path - path[0]) @ axis, axis)
    fits = [_refitted(search, path + stretch * along) for stretch in _STRETCHES]
    nats = np.array([fit.nats for fit in fits])
    shares = np.exp(nats - nats.max())
    mean = np.einsum("n,nka->ka", shares / shares.sum(), np.array([fit.path for fit in fits]))
    return max(search.judged(path), search.judged(mean), key=lambda one: one.nats)


def _refitted(search: ShiftSearch, path: np.ndarray) -> JudgedPath:
    for _ in range(_REFITS):
        path = search.refit(path)
    return search.judged(path)
