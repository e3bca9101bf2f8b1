"""Which points are compared with which: each with its nearest neighbour in every block of scans."""

from dataclasses import dataclass
from typing import Iterable, List, Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.multi_view.parameters import SurfaceMatching
from mlsm_manager.multi_view.placement import PlacedPoints
from mlsm_manager.multi_view.surface_points import ramp

_FADING = 0.8  # share of the cut from which on a pair fades out, so that none appears at once
_COSINE_FADING = 0.1  # the same for the cosine between normals, above the least one


@dataclass(frozen=True)
class Pairs:
    """m comparisons: rows of the compared points and of their neighbours in two sets of placed points.

    importance: (m,) factors of their weights, above 0 to 1.
    """

    rows: np.ndarray
    neighbours: np.ndarray
    importance: np.ndarray


class BlockIndex:
    """A search over the points of some following scans, in which no scan finds its own points."""

    def __init__(self, places: np.ndarray, rows: np.ndarray, scans: np.ndarray) -> None:
        """places: (m, 2) m. rows: (m,) what a found point is called. scans: (m,) that heard the points, ascending."""
        self._places, self._rows, self._scans = places, rows, scans
        self._tree = cKDTree(places)
        self._low, self._high = places.min(axis=0), places.max(axis=0)

    def nearest(self, places: np.ndarray, scans: np.ndarray, cut: float) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return which of `places` (n, 2) have a neighbour nearer than `cut`, the neighbours' rows and distances.

        scans: (n,) that heard the places.
        """
        reached = np.flatnonzero(((places > self._low - cut) & (places < self._high + cut)).all(axis=1))
        by = scans[reached]
        own = (by >= self._scans[0]) & (by <= self._scans[-1])
        found = [_nearest(self._tree, self._rows, places, reached[~own], cut)]
        found += [self._nearest_of_others(scan, places, reached[by == scan], cut) for scan in np.unique(by[own])]
        return tuple(np.concatenate(parts) for parts in zip(*found))

    def _nearest_of_others(self, scan: int, places: np.ndarray, sources: np.ndarray, cut: float) -> tuple:
        others = self._scans != scan
        if not others.any():
            return sources[:0], sources[:0], np.empty(0)
        return _nearest(cKDTree(self._places[others]), self._rows[others], places, sources, cut)


def _nearest(tree: cKDTree, rows: np.ndarray, places: np.ndarray, sources: np.ndarray, cut: float) -> tuple:
    """Return those of `sources` (k,), indices of `places`, that have a neighbour, its row and its distance."""
    if not len(sources):
        return sources, sources, np.empty(0)
    distance, index = tree.query(places[sources], k=1, distance_upper_bound=cut)
    found = np.isfinite(distance)
    return sources[found], rows[index[found]], distance[found]


def blocks_of(points: PlacedPoints, block_scans: int) -> List[BlockIndex]:
    """Return an index for every block of `block_scans` scans that has points."""
    _, starts = np.unique(points.scans // block_scans, return_index=True)
    ends = np.append(starts[1:], len(points))
    rows = [np.arange(start, end) for start, end in zip(starts, ends)]
    return [BlockIndex(points.places[group], group, points.scans[group]) for group in rows]


def pairs_between(
    sources: PlacedPoints, targets: PlacedPoints, blocks: Iterable[BlockIndex], cut: float, matching: SurfaceMatching
) -> Pairs:
    """Return the comparisons of all `sources` with their nearest neighbours in each of the `blocks` of `targets`.

    Points of one scan are never compared with each other, nor surfaces that face different ways. In its own block, a
    point is compared with the nearest one of another scan.
    """
    found = [block.nearest(sources.places, sources.scans, cut) for block in blocks]
    if not found:
        return Pairs(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64), np.empty(0))
    rows, neighbours, distance = (np.concatenate(parts) for parts in zip(*found))
    cosine = np.einsum("na,na->n", sources.normals[rows], targets.normals[neighbours])
    importance = faded(distance, cosine, cut, matching)
    importance = importance * sources.qualities[rows] * targets.qualities[neighbours]
    kept = importance > 0.0
    return Pairs(rows[kept], neighbours[kept], importance[kept])


def faded(distance: np.ndarray, cosine: np.ndarray, cut: float, matching: SurfaceMatching) -> np.ndarray:
    """Return factors (m,) of pairs at `distance` (m,) [m] with `cosine` (m,) between normals: 0 where they drop out."""
    return ramp(distance, cut, _FADING * cut) * ramp(cosine, matching.min_cosine, matching.min_cosine + _COSINE_FADING)
