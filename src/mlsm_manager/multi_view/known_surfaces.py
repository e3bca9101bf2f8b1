"""Surfaces that were in the map before the run: loaded, made without matching, or made before the vehicle was lost."""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.multi_view.association import Pairs, faded
from mlsm_manager.multi_view.parameters import SurfaceMatching
from mlsm_manager.multi_view.placement import PlacedPoints
from mlsm_manager.multi_view.state import BEFORE_THE_RUN
from mlsm_manager.multi_view.surface_points import LEAST_REACH, surface_normals


class KnownSurfaces:
    """A search tree over blocks of a map. A block does not say from which side it was heard."""

    def __init__(self, places: np.ndarray) -> None:
        """places: (n, 2) m, x y of the blocks' means in map."""
        self.places = places
        normals, qualities = surface_normals(places, np.full(len(places), LEAST_REACH))
        known = qualities > 0.0
        self._tree = cKDTree(places[known]) if known.any() else None
        self._points = _placed(places[known], normals[known], qualities[known])

    def compared(self, sources: PlacedPoints, cut: float, matching: SurfaceMatching) -> tuple:
        """Return the Pairs of `sources` with their nearest blocks within `cut` [m], and these as PlacedPoints.

        The blocks' normals point as those of the sources do.
        """
        if self._tree is None or not len(sources):
            nothing = np.empty(0, dtype=np.int64)
            return Pairs(nothing, nothing, np.empty(0)), self._points.selected(nothing)
        distance, index = self._tree.query(sources.places, k=1, distance_upper_bound=cut)
        rows = np.flatnonzero(np.isfinite(distance))
        targets = self._points.selected(index[rows])
        cosine = np.einsum("na,na->n", sources.normals[rows], targets.normals)
        targets = replace(targets, normals=targets.normals * np.where(cosine < 0.0, -1.0, 1.0)[:, np.newaxis])
        importance = faded(distance[rows], np.abs(cosine), cut, matching)
        importance = importance * sources.qualities[rows] * targets.qualities
        kept = importance > 0.0
        return Pairs(rows[kept], np.flatnonzero(kept), importance[kept]), targets


def _placed(places: np.ndarray, normals: np.ndarray, qualities: np.ndarray) -> PlacedPoints:
    count = len(places)
    return PlacedPoints(
        scans=np.full(count, BEFORE_THE_RUN), places=places, arms=np.zeros((count, 2)), normals=normals,
        slants=np.zeros(count), qualities=qualities, shares=np.zeros(count), by_run=np.zeros((count, 2, 2)),
    )  # fmt: skip
