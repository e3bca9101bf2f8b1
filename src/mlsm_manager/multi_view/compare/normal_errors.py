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
    across = _projections(vectors[own, :, 0], places, information.shape[1])
    only_across = across @ information @ across
    gradient_across = np.einsum("gcd,gd->gc", across, gradient)
    return (
        information + lost[..., np.newaxis] * (only_across - information),
        gradient + lost * (gradient_across - gradient),
    )


def _by_translation(information: np.ndarray, places: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Return the information (s, 2, 2) on translations of s scans; own: (g,) which of them a pair compares."""
    parts = information[:, places[:, np.newaxis, :, np.newaxis], places[:, np.newaxis]].sum(axis=(1, 2))
    return np.stack([np.bincount(own, part) for part in parts.reshape(-1, 4).T], axis=1).reshape(-1, 2, 2)


def _projections(directions: np.ndarray, places: np.ndarray, size: int) -> np.ndarray:
    """Return matrices (g, size, size) that take the part along `directions` (g, 2) out of all translations."""
    result = np.tile(np.eye(size), (len(directions), 1, 1))
    along = directions[:, :, np.newaxis] * directions[:, np.newaxis]
    for place in places:
        result[:, place[:, np.newaxis], place] -= along
    return result
