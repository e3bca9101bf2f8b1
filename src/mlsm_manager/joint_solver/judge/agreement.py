"""How well a scan lies on the surfaces that other scans heard."""

from typing import Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.compare.association import Pairs
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placing.placement import PlacedPoints

_ON_SURFACE = 1.0  # deviations within which a point lies on a surface


Met = Sequence[Tuple[Pairs, PlacedPoints, PlacedPoints]]
"""Comparisons with the sets of points that they compare."""


def surfaces_met(met: Met, scan: int) -> np.ndarray:
    """Return the sum (2, 2) of the outer products of the normals of all surfaces that a scan was compared with."""
    total = np.zeros((2, 2))
    for pairs, sources, targets in met:
        own = sources.scans[pairs.rows] == scan
        normals = targets.normals[pairs.neighbours[own]]
        total += np.einsum("n,na,nb->ab", pairs.importance[own], normals, normals)
    return total


def agreement(met: Met, scan: int, parameters: SolverParameters) -> Tuple[float, float]:
    """Return the share of a scan's comparisons in which its point lies on its neighbour's surface, and the mean
    distance [m] from it; 0 without any.
    """
    near = weight = distance = 0.0
    for pairs, sources, targets in met:
        own = sources.scans[pairs.rows] == scan
        i, j = pairs.rows[own], pairs.neighbours[own]
        residual = np.einsum("na,na->n", sources.places[i] - targets.places[j], targets.normals[j])
        variance = parameters.variances(sources.slants[i], targets.slants[j])
        distance += float((pairs.importance[own] * np.abs(residual)).sum())
        near += float(pairs.importance[own][residual**2 < _ON_SURFACE**2 * variance].sum())
        weight += float(pairs.importance[own].sum())
    return (near / weight, distance / weight) if weight else (0.0, 0.0)
