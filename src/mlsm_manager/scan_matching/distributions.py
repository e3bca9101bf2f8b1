"""The map as local distributions: what a point near a block should look like (Segal et al. 2009; Stoyanov et al. 2012).

A block is too small to tell the direction of the wall it belongs to, so each is joined with its neighbours, weighted by
a Gaussian window. A window shows a long wall as if it were as long as the window, and the end of what a scan saw of a
wall as if the wall ended there: both would pull the next scan back to where the last one was taken. So the extent along
the structure comes from a window twice as wide, and what the window itself accounts for, up to a margin, is taken away.
Along a wall a point may slide, while a buoy holds it on all sides. Three points of a far wall often lie across it: the
direction comes from that of the two windows which is surer of it.
"""

from dataclasses import dataclass
from typing import Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.surface_map.blocks import Blocks

_NEIGHBOURS = 16  # blocks that make one distribution: 16 fill the broad window where blocks lie as close as cells allow
_WINDOW_NEIGHBOUR = 2  # to which the window reaches: with the block itself three, the fewest that show a line
_LEAST_WINDOW, _GREATEST_WINDOW = (0.7, 2.5)  # m: above a cell of 0.5 m, below the distance of two jetties
_ALONG_MARGIN = 3.0  # times the information that a window itself makes up along a wall
_PRIOR_POINTS = 2.0  # the typical thickness of surfaces counts as this many points more
_LEAST_DEVIATION = 0.1  # m: range resolution of 50 m in 500 bins
_LONE_DEVIATION = 0.5  # m: a block without neighbours may be anything within its cell
_SURFACE_DEVIATION = 0.4  # m: what is thicker is clutter and no surface
_UNBOUNDED = 100.0  # m: free to slide along a wall


class LocalDistributions:
    """One planar distribution per block.

    mean: (n, 2) m in map. covariance: (n, 2, 2) m^2 of echoes about it.
    """

    def __init__(self, blocks: Blocks) -> None:
        """`blocks` must hold at least one."""
        centers = blocks.mean[:, :2]
        self._tree = cKDTree(centers)
        count = min(_NEIGHBOURS, len(centers))
        distances, neighbours = self._tree.query(centers, k=np.arange(1, count + 1))
        window = np.clip(distances[:, min(_WINDOW_NEIGHBOUR, count - 1)], _LEAST_WINDOW, _GREATEST_WINDOW)
        self.window = window
        near = np.exp(-0.5 * (distances / window[:, np.newaxis]) ** 2)
        self.point_count = (near * blocks.count[neighbours]).sum(axis=1)
        close, broad = (_Window.around(blocks, distances, neighbours, width) for width in (window, 2.0 * window))
        self.mean = close.mean
        self.covariance, thickness = _structure(close, broad)
        self.weight = (1.0 + thickness / _SURFACE_DEVIATION**2) ** -2

    def nearest(self, points: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return for points (n, 2) the distance (n,) to the nearest block and its index (n,)."""
        return self._tree.query(points)


@dataclass(frozen=True)
class _Window:
    """What lies in one window around each block.

    mean: (n, 2) m. covariance: (n, 2, 2) m^2. vectors: (n, 2, 2) its axes as columns, the longer one last. turn: (n,)
    rad^2, about the variance of their direction. members: (n,) to how many points it comes. width: (n,) m.
    """

    mean: np.ndarray
    covariance: np.ndarray
    vectors: np.ndarray
    turn: np.ndarray
    members: np.ndarray
    width: np.ndarray

    @classmethod
    def around(cls, blocks: Blocks, distances: np.ndarray, neighbours: np.ndarray, width: np.ndarray) -> "_Window":
        """Return windows of `width` (n,) over the `neighbours` (n, k) of each block, at `distances` (n, k) m."""
        counts, centers = blocks.count[neighbours], blocks.mean[neighbours, :2]
        weights = np.sqrt(counts) * np.exp(-0.5 * (distances / width[:, np.newaxis]) ** 2)
        weights = weights / weights.sum(axis=1, keepdims=True)
        mean = np.einsum("ij,ijk->ik", weights, centers)
        spread = centers - mean[:, np.newaxis, :]
        covariance = np.einsum("ij,ija,ijb->iab", weights, spread, spread)
        own = np.einsum("ij,ijk->ik", weights, blocks.variance[neighbours, :2])
        covariance[:, 0, 0] += own[:, 0]
        covariance[:, 1, 1] += own[:, 1]
        values, vectors = np.linalg.eigh(covariance)
        members = 1.0 / (weights**2 / counts).sum(axis=1)
        turn = (values[:, 0] + _LEAST_DEVIATION**2) / (values[:, 1] + _LEAST_DEVIATION**2) / members
        return cls(mean, covariance, vectors, turn, members, width)

    def along(self, axes: np.ndarray) -> np.ndarray:
        """Return the variance (n,) along `axes` (n, 2)."""
        return np.einsum("na,nab,nb->n", axes, self.covariance, axes)


def _structure(close: _Window, broad: _Window) -> Tuple[np.ndarray, np.ndarray]:
    """Return covariance (n, 2, 2) and thickness (n,) of each block."""
    vectors = np.where((broad.turn < close.turn)[:, np.newaxis, np.newaxis], broad.vectors, close.vectors)
    across, members = close.along(vectors[:, :, 0]), close.members
    sure = (members >= 3.0) & (across < _SURFACE_DEVIATION**2)
    typical = max(float(np.median(across[sure])) if sure.any() else 0.0, _LEAST_DEVIATION**2)
    # With few members a line through them fits too well; the deviation found elsewhere counts as two more.
    across = (members * across + _PRIOR_POINTS * typical) / (members + _PRIOR_POINTS)
    # Two points always lie on a line: whether they are a structure or clutter, only a third can tell.
    known = np.clip((members - 1.0) / 2.0, 0.0, 1.0)
    across = known * across + (1.0 - known) * np.maximum(_LONE_DEVIATION**2, across)
    along = np.maximum(broad.along(vectors[:, :, 1]), across)
    information = np.maximum(1.0 / along - _ALONG_MARGIN / broad.width**2, _UNBOUNDED**-2)
    values = np.column_stack([across, 1.0 / information])
    return np.einsum("iak,ik,ibk->iab", vectors, values, vectors), across
