"""Which points are compared with which: each with the nearest ones of other scans in every block of scans."""

from typing import Tuple

import numpy as np

from mlsm_manager.joint_solver.compiled.compiled_cells import Cells, sorted_into_cells
from mlsm_manager.joint_solver.compiled.compiled_search import shared_neighbours
from mlsm_manager.joint_solver.placing.placement import PlacedPoints

TIE = 0.05
"""m by which a neighbour may be farther than the nearest one and still count in part. Were it 0, the nearest one would
be decided by the last bit where two are equally near. More would compare each point with more neighbours."""


class Neighbours:
    """Finds for each point and each block of scans the nearest points of other scans."""

    def __init__(self, targets: PlacedPoints, group_scans: int) -> None:
        """targets: ascending by scan; every `group_scans` scans of them are searched together."""
        _, blocks = np.unique(targets.scans // group_scans, return_inverse=True)
        self._blocks = blocks.astype(np.int64)
        self._count = int(blocks[-1]) + 1 if len(blocks) else 0

    def within(self, sources: PlacedPoints, targets: PlacedPoints, cut: float) -> Tuple[np.ndarray, ...]:
        """Return rows of sources, rows of their neighbours, distances [m] and shares, each (m,), up to `cut` [m].

        For each source and each block of scans these are the nearest targets of other scans, and their shares add up
        to 1. targets: those of the beginning, perhaps moved. Raises ValueError for places that are not finite.
        """
        if not len(sources) or not len(targets):
            nothing = np.empty(0, dtype=np.int64)
            return nothing, nothing, np.empty(0), np.empty(0)
        for points in (sources, targets):
            if not np.isfinite(points.places).all():
                nowhere = np.count_nonzero(~np.isfinite(points.places).all(axis=1))
                raise ValueError(f"{nowhere} of {len(points)} points without a finite place")
        places, other_places = np.ascontiguousarray(sources.places), np.ascontiguousarray(targets.places)
        cells = Cells(*sorted_into_cells(places, other_places, cut + TIE))
        return shared_neighbours(
            places, np.ascontiguousarray(sources.scans), other_places, np.ascontiguousarray(targets.scans),
            self._blocks, self._count, cut, TIE, *cells,
        )  # fmt: skip


def shares_of(distance: np.ndarray, nearest: np.ndarray) -> np.ndarray:
    """Return which shares (k, n) of the comparison of a point its k candidates at `distance` (k, n) [m] have.

    nearest: (n,) the least distance of each point. The shares add up to 1.
    """
    share = np.maximum(1.0 - (distance - nearest) / TIE, 0.0)
    return share / share.sum(axis=0)
