"""Which points are compared with which: each with its nearest neighbour in every block of scans."""

from dataclasses import dataclass, replace
from typing import Callable, Protocol, Tuple

import numpy as np

from mlsm_manager.joint_solver.measured.surface_points import ramp
from mlsm_manager.joint_solver.parameters import SurfaceMatching
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


class Neighbours(Protocol):
    """Finds neighbours in a set of targets."""

    def within(self, sources: PlacedPoints, targets: PlacedPoints, cut: float) -> Tuple[np.ndarray, ...]:
        """Return rows of sources, rows of their neighbours, distances [m] and shares, each (m,), up to `cut` [m].

        For each source and each block of scans these are the nearest targets of other scans, and their shares add up
        to 1. Sources and targets are those of the beginning, perhaps moved.
        """


Weighing = Callable[[Tuple[np.ndarray, ...], PlacedPoints, PlacedPoints, float, SurfaceMatching], Pairs]
"""Takes what Neighbours.within found, sources, targets, the cut [m] and the matching; returns the pairs that count."""


def weighed(
    found: Tuple[np.ndarray, ...], sources: PlacedPoints, targets: PlacedPoints, cut: float, matching: SurfaceMatching
) -> Pairs:
    """Return the pairs that count; see Weighing."""
    rows, neighbours, distance, shares = found
    cosine = np.einsum("na,na->n", sources.normals[rows], targets.normals[neighbours])
    importance = shares * faded(distance, cosine, cut, matching)
    importance = importance * sources.qualities[rows] * targets.qualities[neighbours]
    kept = importance > 0.0
    return Pairs(rows[kept], neighbours[kept], importance[kept])


def pairs_of(
    lists: Neighbours,
    sources: PlacedPoints,
    targets: PlacedPoints,
    cut: float,
    matching: SurfaceMatching,
    weighing: Weighing = weighed,
) -> Pairs:
    """Return the comparisons of all `sources` with their nearest neighbours in each block of `targets`.

    Points of one scan are never compared with each other, nor surfaces that face different ways. In its own block, a
    point is compared with the nearest one of another scan. Neighbours that are as near share the comparison.
    """
    return weighing(lists.within(sources, targets, cut), sources, targets, cut, matching)


def faded(distance: np.ndarray, cosine: np.ndarray, cut: float, matching: SurfaceMatching) -> np.ndarray:
    """Return factors (m,) of pairs at `distance` (m,) [m] with `cosine` (m,) between normals: 0 where they drop out."""
    return ramp(distance, cut, FADING * cut) * ramp(cosine, matching.min_cosine, matching.min_cosine + COSINE_FADING)
