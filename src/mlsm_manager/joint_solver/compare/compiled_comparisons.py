"""Comparisons in compiled loops: the same as in `neighbours` and `comparisons` but for rounding; only the time differs.

Their time is short enough to look for all neighbours anew each time, where numpy has to keep lists of them.
"""

from typing import Tuple

import numpy as np

from mlsm_manager.joint_solver.compare.association import COSINE_FADING, FADING, Pairs
from mlsm_manager.joint_solver.compare.neighbours import TIE
from mlsm_manager.joint_solver.compiled.compiled_cells import Cells, sorted_into_cells
from mlsm_manager.joint_solver.compiled.compiled_search import shared_neighbours
from mlsm_manager.joint_solver.compiled.compiled_sums import POINT_COLUMNS, scattered_blocks, summed_comparisons
from mlsm_manager.joint_solver.compiled.compiled_weights import weighed_pairs
from mlsm_manager.joint_solver.parameters import SurfaceMatching
from mlsm_manager.joint_solver.placing.placement import PlacedPoints


class CompiledNeighbours:
    """See NeighbourLists."""

    def __init__(self, targets: PlacedPoints, block_scans: int) -> None:
        """targets: ascending by scan; every `block_scans` scans of them are searched together."""
        _, blocks = np.unique(targets.scans // block_scans, return_inverse=True)
        self._blocks = blocks.astype(np.int64)
        self._count = int(blocks[-1]) + 1 if len(blocks) else 0

    def within(self, sources: PlacedPoints, targets: PlacedPoints, cut: float) -> Tuple[np.ndarray, ...]:
        """See association.Neighbours. Raises ValueError for places that are not finite."""
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


def weighed_compiled(
    found: Tuple[np.ndarray, ...], sources: PlacedPoints, targets: PlacedPoints, cut: float, matching: SurfaceMatching
) -> Pairs:
    """Return the pairs that count; see association.Weighing."""
    normals, other_normals = (np.ascontiguousarray(points.normals) for points in (sources, targets))
    return Pairs(
        *weighed_pairs(
            *found, normals, sources.qualities, other_normals, targets.qualities,
            cut, FADING * cut, matching.min_cosine, matching.min_cosine + COSINE_FADING,
        )
    )  # fmt: skip


def summed_compiled(
    pairs: Pairs, sources: PlacedPoints, targets: PlacedPoints, matching: SurfaceMatching, cut: float
) -> Tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return what the comparisons of each pair of scans say; see Summation.

    Those whose sources are of one scan must follow each other.
    """
    packed = _packed(sources)
    return summed_comparisons(
        pairs.rows, pairs.neighbours, pairs.importance,
        packed, sources.scans, packed if targets is sources else _packed(targets), targets.scans,
        matching.range_deviation**2, matching.beam_half_width**2, matching.weight, max(1.0, cut / matching.cut),
    )  # fmt: skip


def scattered_compiled(matrix: np.ndarray, columns: np.ndarray, blocks: np.ndarray) -> None:
    """Add blocks to a matrix; see Scattering."""
    scattered_blocks(matrix, np.ascontiguousarray(columns), np.ascontiguousarray(blocks))


def _packed(points: PlacedPoints) -> np.ndarray:
    """Return points as rows (n, POINT_COLUMNS) of the compiled loops."""
    rows = np.empty((len(points), POINT_COLUMNS))
    rows[:, 0:2], rows[:, 2:4], rows[:, 4:6] = points.places, points.arms, points.normals
    rows[:, 6], rows[:, 7], rows[:, 8:12] = points.slants, points.shares, points.by_run.reshape(-1, 4)
    return rows
