"""Comparisons of points with surfaces that other scans heard: which count, how much, what they say of the unknowns.

A point is compared with its nearest neighbours in every group of scans.
"""

from typing import Tuple

import numpy as np

from mlsm_manager.joint_solver.compiled_comparisons import (
    POINT_COLUMNS,
    Limits,
    Noise,
    Packed,
    Pairs,
    Surfaces,
    summed_comparisons,
    weighed_pairs,
)
from mlsm_manager.joint_solver.compiled_neighbours import shared_neighbours
from mlsm_manager.joint_solver.normal_equations import POSE_COLUMNS, RUN_COLUMNS, Layout, NormalEquations
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.surface_points import ramp
from mlsm_manager.joint_solver.weak_directions import discounted

TIE = 0.05
"""m by which a neighbour may be farther than the nearest one and still count in part. Were it 0, the nearest one would
be decided by the last bit where two are equally near. More would compare each point with more neighbours."""
FADING = 0.8  # share of the cut from which on a pair fades out, so that none appears at once
COSINE_FADING = 0.1  # the same for the cosine between normals, above the least one
_PLACES = POSE_COLUMNS * np.arange(4)[:, np.newaxis] + np.arange(2)  # columns of x and y of a pair's nodes


class Neighbours:
    """Finds for each point and each group of scans the nearest points of other scans."""

    def __init__(self, targets: PlacedPoints, group_scans: int) -> None:
        """targets: ascending by scan; every `group_scans` scans of them are searched together."""
        _, groups = np.unique(targets.scans // group_scans, return_inverse=True)
        self._groups = groups.astype(np.int64)

    def within(self, sources: PlacedPoints, targets: PlacedPoints, cut: float) -> Tuple[np.ndarray, ...]:
        """Return rows of sources, rows of their neighbours, distances [m] and shares, each (m,), up to `cut` [m].

        For each source and each group of scans these are the nearest targets of other scans, and their shares add up
        to 1. targets: those of the beginning, perhaps moved. Raises ValueError for places that are not finite.
        """
        if not len(sources.scans) or not len(targets.scans):
            nothing = np.empty(0, dtype=np.int64)
            return nothing, nothing, np.empty(0), np.empty(0)
        for points in (sources, targets):
            if not np.isfinite(points.places).all():
                nowhere = np.count_nonzero(~np.isfinite(points.places).all(axis=1))
                raise ValueError(f"{nowhere} of {len(points)} points without a finite place")
        arrays = sources.places, sources.scans, targets.places, targets.scans
        return shared_neighbours(*(np.ascontiguousarray(array) for array in arrays), self._groups, cut, TIE)


def shares_of(distance: np.ndarray, nearest: np.ndarray) -> np.ndarray:
    """Return which shares (k, n) of the comparison of a point its k candidates at `distance` (k, n) [m] have.

    nearest: (n,) the least distance of each point. The shares add up to 1.
    """
    share = np.maximum(1.0 - (distance - nearest) / TIE, 0.0)
    return share / share.sum(axis=0)


def pairs_of(
    lists: Neighbours, sources: PlacedPoints, targets: PlacedPoints, cut: float, parameters: SolverParameters
) -> Pairs:
    """Return the comparisons of all `sources` with their nearest neighbours in each group of `targets` that count.

    Points of one scan are never compared with each other, nor surfaces that face different ways. In its own group, a
    point is compared with the nearest one of another scan. Neighbours that are as near share the comparison.
    """
    own, others = (Surfaces(np.ascontiguousarray(points.normals), points.qualities) for points in (sources, targets))
    limits = Limits(cut, FADING * cut, parameters.min_cosine, parameters.min_cosine + COSINE_FADING)
    return weighed_pairs(lists.within(sources, targets, cut), own, others, limits)


def faded(distance: np.ndarray, cosine: np.ndarray, cut: float, parameters: SolverParameters) -> np.ndarray:
    """Return factors (m,) of pairs at `distance` (m,) [m] with `cosine` (m,) between normals: 0 where they drop out."""
    return ramp(distance, cut, FADING * cut) * ramp(
        cosine, parameters.min_cosine, parameters.min_cosine + COSINE_FADING
    )


def add_comparisons(
    equations: NormalEquations,
    layout: Layout,
    pairs: Pairs,
    sources: PlacedPoints,
    targets: PlacedPoints,
    parameters: SolverParameters,
    cut: float,
) -> int:
    """Add the distances of `sources` from their neighbours' surfaces; return how many there are."""
    if not len(pairs.rows):
        return 0
    scans, other_scans, information, gradient = summed(pairs, sources, targets, parameters, cut)
    if parameters.normal_deviation > 0.0:
        # The parts of a turn together hear walls on all sides, each part alone perhaps one.
        turns = scans // parameters.parts_per_turn
        information, gradient = discounted(information, gradient, turns, _PLACES, parameters.normal_deviation)
    equations.add_terms(_columns(scans, other_scans, layout), information, gradient)
    return len(pairs.rows)


def summed(
    pairs: Pairs, sources: PlacedPoints, targets: PlacedPoints, parameters: SolverParameters, cut: float
) -> Tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return what the comparisons of each of g pairs of scans say, up to `cut` [m].

    These are the scans of sources (g,) and of targets (g,), their information (g, 14, 14) and gradients (g, 14). The
    columns are the poses of the source's two nodes, those of the target's two nodes, and the run's unknowns. Pairs
    whose sources are of one scan must follow each other.

    Noise is one of the reported ranges. The residuals are therefore those per unit of range scale, which the
    derivative by it contains; else the fit would shrink the world to make them smaller. A beam that meets a surface
    aslant may have heard it anywhere in its width: such a point is less certain. The kernel is Geman and McClure's
    (1985), wider while the cut is.
    """
    own = _packed(sources)
    others = own if targets is sources else _packed(targets)
    widening = max(1.0, cut / parameters.cut)
    noise = Noise(parameters.echo_deviation**2, parameters.beam_half_width**2, parameters.weight)
    return summed_comparisons(tuple(pairs), own, others, noise, widening)


def _packed(points: PlacedPoints) -> Packed:
    rows = np.empty((len(points.scans), POINT_COLUMNS))
    rows[:, 0:2], rows[:, 2:4], rows[:, 4:6] = points.places, points.arms, points.normals
    rows[:, 6], rows[:, 7], rows[:, 8:12] = points.slants, points.shares, points.by_run.reshape(-1, 4)
    return Packed(rows, points.scans)


def support(pairs: Pairs, sources: PlacedPoints, targets: PlacedPoints, parameters: SolverParameters) -> float:
    """Return the log likelihood of the places of points by their comparisons: what the robust kernel leaves of each."""
    i, j = pairs.rows, pairs.neighbours
    residual = np.einsum("na,na->n", sources.places[i] - targets.places[j], targets.normals[j])
    ratio = residual**2 / parameters.variances(sources.slants[i], targets.slants[j])
    return float(0.5 * parameters.weight * (pairs.importance / (1.0 + ratio)).sum())


def _columns(scans: np.ndarray, other_scans: np.ndarray, layout: Layout) -> np.ndarray:
    nodes = np.column_stack([scans, scans + 1, other_scans, other_scans + 1])
    poses = layout.pose_columns(nodes)
    run = np.broadcast_to(layout.run_start + np.arange(RUN_COLUMNS), (len(scans), RUN_COLUMNS))
    return np.concatenate([poses.reshape(len(scans), -1), run], axis=1)
