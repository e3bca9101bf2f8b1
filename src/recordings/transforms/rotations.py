"""Unit quaternions (..., 4), x y z w, many at once."""

import numpy as np

# A norm outside says that something else than a rotation was written.
_NORMS = (0.5, 2.0)


def normalized(quaternions: np.ndarray) -> np.ndarray:
    """Return quaternions (..., 4) of length one; NaN for those that are no rotation or not finite."""
    norms = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        valid = (norms > _NORMS[0]) & (norms < _NORMS[1])
        return np.where(valid, quaternions / np.where(valid, norms, 1.0), np.nan)


def between(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return the rotation at `share` (n,) of the shortest way from `first` (n, 4) to `second` (n, 4), as tf2 does."""
    cosine = np.einsum("ni,ni->n", first, second)
    second = np.where(cosine[:, np.newaxis] < 0.0, -second, second)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    apart = angle > 0.0
    sine = np.where(apart, np.sin(angle), 1.0)
    left = np.where(apart, np.sin((1.0 - share) * angle) / sine, 1.0)
    right = np.where(apart, np.sin(share * angle) / sine, 0.0)
    return left[:, np.newaxis] * first + right[:, np.newaxis] * second


def rotation_matrices(quaternions: np.ndarray) -> np.ndarray:
    """Return (n, 3, 3) rotations of unit quaternions (n, 4)."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)
