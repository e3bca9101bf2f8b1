"""Takes away what the errors of a scan's normals seem to say along the direction that its surfaces tell least of.

WeakDirections takes away what the scans around tell nothing of; this is what a single scan, which hears less, adds.
"""

from typing import Tuple

import numpy as np

_MOST = 2.0
"""Times normal_deviation: how far the normals of one scan may err. The told deviation was too small in one simulated
canal of six with 1.0, in none of twelve with 2.0."""
_NOTHING = 1e-12  # 1/m^2: keeps scans without information from dividing by zero


def discounted(
    information: np.ndarray, gradient: np.ndarray, scans: np.ndarray, places: np.ndarray, normal_deviation: float
) -> Tuple[np.ndarray, np.ndarray]:
    """Return `information` (g, c, c) and `gradient` (g, c) of g pairs of scans without what errors of normals say.

    scans: (g,) the compared scan of each pair. places: (4, 2) columns of x and y of a pair's nodes, first those of the
    compared scan. normal_deviation: rad, of the surfaces' normals.

    The walls of a straight canal tell nothing of the way along it. Normals that err by some degrees seem to tell it.
    What they say is that nothing moves, since every point is compared with its nearest neighbour. So the information
    along the direction that all pairs of a scan tell least of counts only as far as it exceeds (2 normal_deviation)^2
    of that across it.
    """
    if not len(scans):
        return information, gradient
    _, own = np.unique(scans, return_inverse=True)
    values, vectors = np.linalg.eigh(_by_translation(information, places[:2], own))
    errors = (_MOST * normal_deviation) ** 2 * values[:, 1]
    lost = np.minimum(1.0, errors / np.maximum(values[:, 0], _NOTHING))[own, np.newaxis]
    directions = vectors[own, :, 0]
    across, gradient_across = information.copy(), gradient[..., np.newaxis].copy()
    for values in (across, across.transpose(0, 2, 1), gradient_across):
        _take_out(directions, places, values)
    return _between(information, across, lost[..., np.newaxis]), _between(gradient, gradient_across[..., 0], lost)


def _between(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return first + share * (second - first), in place of `second`: whole runs have 100 MB of them."""
    second -= first
    second *= share
    second += first
    return second


def _by_translation(information: np.ndarray, places: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Return the information (s, 2, 2) on translations of s scans; own: (g,) which of them a pair compares."""
    parts = information[:, places[:, np.newaxis, :, np.newaxis], places[:, np.newaxis]].sum(axis=(1, 2))
    return np.stack([np.bincount(own, part) for part in parts.reshape(-1, 4).T], axis=1).reshape(-1, 2, 2)


def _take_out(directions: np.ndarray, places: np.ndarray, values: np.ndarray) -> None:
    """Take the part along `directions` (g, 2) out of all translations, which `values` (g, c, k) are of, in place."""
    along_x, along_y = directions[:, :1], directions[:, 1:]
    for x, y in places:
        along = along_x * values[:, x] + along_y * values[:, y]
        values[:, x] -= along_x * along
        values[:, y] -= along_y * along
