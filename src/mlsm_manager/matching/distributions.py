"""The map as local distributions: what a point near a block should look like (Segal et al. 2009; Stoyanov et al. 2012).

A block is too small to tell the direction of the wall it belongs to, so each is joined with its neighbours, weighted by
a Gaussian window. A window of width h shows a long wall as if it were h long, so its information along the wall,
up to a margin, is the window's and not the wall's, and is taken away: along a wall a point may slide, while a buoy
holds it on all sides.
"""

from typing import Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.blocks import Blocks

_NEIGHBOURS = 16
_WINDOW_NEIGHBOUR = 5
_LEAST_WINDOW = 0.7
_GREATEST_WINDOW = 2.5
_ALONG_MARGIN = 3.0
_PRIOR_POINTS = 2.0
_LEAST_DEVIATION = 0.05


class LocalDistributions:
    """One planar distribution per block.

    mean: (n, 2) m in map. information: (n, 2, 2) inverse of the covariance of echoes about it, 1/m^2.
    deviation: m, how far echoes typically lie from the line that their neighbours make.
    """

    def __init__(self, blocks: Blocks) -> None:
        """`blocks` must hold at least one."""
        centers = blocks.mean[:, :2]
        self._tree = cKDTree(centers)
        weights, neighbours, window = self._windows(centers, np.sqrt(blocks.count))
        self.mean = np.einsum("ij,ijk->ik", weights, centers[neighbours])
        spread = centers[neighbours] - self.mean[:, np.newaxis, :]
        covariance = np.einsum("ij,ija,ijb->iab", weights, spread, spread)
        own = np.einsum("ij,ijk->ik", weights, blocks.variance[neighbours, :2])
        covariance[:, 0, 0] += own[:, 0]
        covariance[:, 1, 1] += own[:, 1]
        members = 1.0 / (weights**2).sum(axis=1)
        self.deviation, self.information = _information(covariance, members, window)

    def nearest(self, points: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return for points (n, 2) the distance (n,) to the nearest block and its index (n,)."""
        return self._tree.query(points)

    def _windows(self, centers: np.ndarray, mass: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        count = min(_NEIGHBOURS, len(centers))
        distances, neighbours = self._tree.query(centers, k=np.arange(1, count + 1))
        window = distances[:, min(_WINDOW_NEIGHBOUR, count - 1)]
        window = np.clip(window, _LEAST_WINDOW, _GREATEST_WINDOW)
        weights = mass[neighbours] * np.exp(-0.5 * (distances / window[:, np.newaxis]) ** 2)
        return weights / weights.sum(axis=1, keepdims=True), neighbours, window


def _information(covariance: np.ndarray, members: np.ndarray, window: np.ndarray) -> Tuple[float, np.ndarray]:
    values, vectors = np.linalg.eigh(covariance)
    sure = members >= 3.0
    typical = float(np.median(values[sure, 0])) if sure.any() else 0.0
    typical = max(typical, _LEAST_DEVIATION**2)
    # With few members a line through them fits too well; the deviation found elsewhere counts as two more.
    values = (members[:, np.newaxis] * values + _PRIOR_POINTS * typical) / (members[:, np.newaxis] + _PRIOR_POINTS)
    values = np.maximum(values, _LEAST_DEVIATION**2)
    information = 1.0 / values
    information[:, 1] = np.maximum(information[:, 1] - _ALONG_MARGIN / window**2, 0.0)
    return float(np.sqrt(typical)), np.einsum("iak,ik,ibk->iab", vectors, information, vectors)
