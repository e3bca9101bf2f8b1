"""Which points are compared with which: each with its nearest neighbour in every block of scans."""

from dataclasses import dataclass
from typing import Iterable, List, Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.multi_view.parameters import SurfaceMatching
from mlsm_manager.multi_view.placement import PlacedPoints

_FEWEST = 8  # a block of fewer points is no surface to compare with


@dataclass(frozen=True)
class Pairs:
    """m comparisons: rows of the compared points and of their neighbours in two sets of placed points."""

    rows: np.ndarray
    neighbours: np.ndarray


class BlockIndex:
    """A search tree over the points of some following scans."""

    def __init__(self, places: np.ndarray, rows: np.ndarray) -> None:
        self._tree = cKDTree(places)
        self._rows = rows
        self._low, self._high = places.min(axis=0), places.max(axis=0)

    def nearest(self, places: np.ndarray, cut: float) -> Tuple[np.ndarray, np.ndarray]:
        """Return which of `places` (n, 2) have a neighbour nearer than `cut`, and the neighbours' rows."""
        reached = np.flatnonzero(((places > self._low - cut) & (places < self._high + cut)).all(axis=1))
        if not len(reached):
            return reached, reached
        distance, index = self._tree.query(places[reached], k=1, distance_upper_bound=cut)
        found = np.isfinite(distance)
        return reached[found], self._rows[index[found]]


def blocks_of(points: PlacedPoints, block_scans: int) -> List[BlockIndex]:
    """Return an index for every block of `block_scans` scans that has enough points."""
    _, starts = np.unique(points.scans // block_scans, return_index=True)
    ends = np.append(starts[1:], len(points))
    rows = [np.arange(start, end) for start, end in zip(starts, ends) if end - start >= _FEWEST]
    return [BlockIndex(points.places[group], group) for group in rows]


def pairs_between(
    sources: PlacedPoints, targets: PlacedPoints, blocks: Iterable[BlockIndex], cut: float, matching: SurfaceMatching
) -> Pairs:
    """Return the comparisons of all `sources` with their nearest neighbours in each of the `blocks` of `targets`.

    Points of one scan are never compared with each other, nor surfaces that face different ways.
    """
    found = [block.nearest(sources.places, cut) for block in blocks]
    empty = np.empty(0, dtype=np.int64)
    rows = np.concatenate([empty, *(source for source, _ in found)])
    neighbours = np.concatenate([empty, *(target for _, target in found)])
    cosine = np.einsum("na,na->n", sources.normals[rows], targets.normals[neighbours])
    kept = (sources.scans[rows] != targets.scans[neighbours]) & (cosine > matching.min_cosine)
    return Pairs(rows[kept], neighbours[kept])
