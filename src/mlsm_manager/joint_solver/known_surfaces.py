"""Surfaces that were in the map before the run: loaded, made without matching, or made before the vehicle was lost."""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.joint_solver.comparisons import COSINE_FADING, FADING, TIE
from mlsm_manager.joint_solver.compiled_comparisons import Pairs
from mlsm_manager.joint_solver.normal_equations import BEFORE_THE_RUN
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.surface_points import LEAST_REACH, ramp, surface_normals
from node_support.geometry import cell_keys, cells_of, keys_of

_CANDIDATES = 3  # blocks that are looked at for each point: more than there usually are as near as the nearest one
_SQUARE = 32.0  # m: side of the squares into which blocks are sorted, to find those of an area without looking at all
_MARGIN = 64.0  # m beyond the scans: so far the vehicle may go before other blocks are looked at


class KnownSurfaces:
    """A search tree over the blocks of a map around the vehicle. A block does not say from which side it was heard.

    Beginning costs a sort of all blocks, comparing depends on those around the vehicle only.
    """

    def __init__(self, places: np.ndarray) -> None:
        """places: (n, 2) m, x y of the blocks' means in map."""
        keys = keys_of(places, _SQUARE)
        order = np.argsort(keys, kind="stable")
        self.places, self._keys = places[order], keys[order]
        self._low, self._high = np.full(2, np.inf), np.full(2, -np.inf)
        self._look_at(np.empty((0, 2)))

    def _look_at(self, places: np.ndarray) -> None:
        """Build the tree over blocks at places (n, 2)."""
        normals, qualities = surface_normals(places, np.full(len(places), LEAST_REACH))
        known = qualities > 0.0
        self._tree, count = cKDTree(places[known]) if known.any() else None, np.count_nonzero(known)
        self._points = PlacedPoints(
            scans=np.full(count, BEFORE_THE_RUN), places=places[known], arms=np.zeros((count, 2)),
            normals=normals[known], slants=np.zeros(count), qualities=qualities[known], shares=np.zeros(count),
            by_run=np.zeros((count, 2, 2)),
        )  # fmt: skip

    def _reach(self, places: np.ndarray, cut: float) -> None:
        """Look at all blocks around `places` (n, 2), n > 0, if some that lie within `cut` [m] are not looked at yet."""
        low, high = places.min(axis=0) - cut, places.max(axis=0) + cut
        if (low >= self._low).all() and (high <= self._high).all():
            return
        first, last = cells_of(np.array([low - _MARGIN, high + _MARGIN]), _SQUARE)
        columns = np.arange(first[0], last[0] + 1)
        starts, ends = (
            np.searchsorted(self._keys, cell_keys(np.column_stack([columns, np.full(len(columns), row)])))
            for row in (first[1], last[1] + 1)
        )
        parts = [self.places[start:end] for start, end in zip(starts, ends)]
        # A block at the border has not all its neighbours, so only what lies within it is relied on.
        self._low, self._high = first * _SQUARE + LEAST_REACH, (last + 1) * _SQUARE - LEAST_REACH
        self._look_at(np.concatenate(parts))

    def around(self, low: np.ndarray, high: np.ndarray) -> PlacedPoints:
        """Return the blocks from `low` to `high`, (2,) m each, whose surfaces are known."""
        self._reach(np.stack([low, high]), 0.0)
        points = self._points
        return points.selected(((points.places >= low) & (points.places <= high)).all(axis=1))

    def compared(self, sources: PlacedPoints, cut: float, parameters: SolverParameters) -> tuple:
        """Return m Pairs of `sources` with their nearest blocks within `cut` [m], and these as m PlacedPoints.

        Blocks that are as near share the comparison. The blocks' normals point as those of the sources do.
        """
        if len(sources):
            self._reach(sources.places, cut)
        if self._tree is None or not len(sources):
            nothing = np.empty(0, dtype=np.int64)
            return Pairs(nothing, nothing, np.empty(0)), self._points.selected(nothing)
        distance, index = self._tree.query(sources.places, k=_CANDIDATES, distance_upper_bound=cut)
        near = np.flatnonzero(np.isfinite(distance[:, 0]))
        share = np.maximum(1.0 - (distance[near] - distance[near, :1]) / TIE, 0.0)
        share = (share.T / share.T.sum(axis=0)).T
        own, rank = np.nonzero(share)
        rows, distance, share = near[own], distance[near[own], rank], share[own, rank]
        targets = self._points.selected(index[rows, rank])
        cosine = np.einsum("na,na->n", sources.normals[rows], targets.normals)
        targets = replace(targets, normals=targets.normals * np.where(cosine < 0.0, -1.0, 1.0)[:, np.newaxis])
        fading = ramp(distance, cut, FADING * cut)
        fading = fading * ramp(np.abs(cosine), parameters.min_cosine, parameters.min_cosine + COSINE_FADING)
        importance = share * fading * sources.qualities[rows] * targets.qualities
        kept = importance > 0.0
        return Pairs(rows[kept], np.arange(int(kept.sum())), importance[kept]), targets.selected(kept)
