"""Comparisons of points with their nearest neighbours, and how much each of them counts."""

from dataclasses import dataclass, replace

import numpy as np

from mlsm_manager.joint_solver.compare.neighbours import Neighbours
from mlsm_manager.joint_solver.compiled.compiled_weights import weighed_pairs
from mlsm_manager.joint_solver.measured.surface_points import ramp
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placing.placement import PlacedPoints

FADING = 0.8  # share of the cut from which on a pair fades out, so that none appears at once
COSINE_FADING = 0.1  # the same for the cosine between normals, above the least one


@dataclass(frozen=True)
class Pairs:
    """m comparisons: rows of the compared points and of their neighbours in two sets of placed points.

    importance: (m,) factors of their weights, above 0 to 1.
    """

    rows: np.ndarray
    neighbours: np.ndarray
    importance: np.ndarray

    def weighted(self, factors: np.ndarray) -> "Pairs":
        """Return the comparisons with their importance times the factor of their neighbour; factors: (k,)."""
        return replace(self, importance=self.importance * factors[self.neighbours])


def pairs_of(
    lists: Neighbours, sources: PlacedPoints, targets: PlacedPoints, cut: float, parameters: SolverParameters
) -> Pairs:
    """Return the comparisons of all `sources` with their nearest neighbours in each block of `targets` that count.

    Points of one scan are never compared with each other, nor surfaces that face different ways. In its own block, a
    point is compared with the nearest one of another scan. Neighbours that are as near share the comparison.
    """
    normals, other_normals = (np.ascontiguousarray(points.normals) for points in (sources, targets))
    return Pairs(
        *weighed_pairs(
            *lists.within(sources, targets, cut), normals, sources.qualities, other_normals, targets.qualities,
            cut, FADING * cut, parameters.min_cosine, parameters.min_cosine + COSINE_FADING,
        )
    )  # fmt: skip


def faded(distance: np.ndarray, cosine: np.ndarray, cut: float, parameters: SolverParameters) -> np.ndarray:
    """Return factors (m,) of pairs at `distance` (m,) [m] with `cosine` (m,) between normals: 0 where they drop out."""
    return ramp(distance, cut, FADING * cut) * ramp(
        cosine, parameters.min_cosine, parameters.min_cosine + COSINE_FADING
    )
