"""Residuals of points against the surfaces that other scans heard, as normal equations."""

from typing import Callable, Tuple

import numpy as np

from mlsm_manager.joint_solver.compare.association import Pairs
from mlsm_manager.joint_solver.compare.normal_errors import discounted
from mlsm_manager.joint_solver.parameters import SurfaceMatching
from mlsm_manager.joint_solver.placing.placement import PlacedPoints
from mlsm_manager.joint_solver.unknowns.normal_equations import NormalEquations
from mlsm_manager.joint_solver.unknowns.state import BEFORE_THE_RUN, POSE_COLUMNS, RANGE_SCALE, RUN_COLUMNS, Layout

_PAIR_COLUMNS = 4 * POSE_COLUMNS + RUN_COLUMNS
_PLACES = POSE_COLUMNS * np.arange(4)[:, np.newaxis] + np.arange(2)  # columns of x and y of a pair's nodes
Summation = Callable[[Pairs, PlacedPoints, PlacedPoints, SurfaceMatching, float], Tuple[np.ndarray, ...]]
"""Takes pairs, sources, targets, matching and the cut [m]; returns the scans of sources (g,) and of targets (g,) of all
pairs of scans that are compared, their information (g, 14, 14) and gradients (g, 14); the columns are those of
`linearised`."""
_MOST_SCANS = 10**8  # two scan numbers fit into one integer key


def add_comparisons(
    equations: NormalEquations,
    layout: Layout,
    pairs: Pairs,
    sources: PlacedPoints,
    targets: PlacedPoints,
    matching: SurfaceMatching,
    cut: float,
    summation: Summation,
) -> int:
    """Add the distances of `sources` from their neighbours' surfaces; return how many there are."""
    if not len(pairs.rows):
        return 0
    scans, other_scans, information, gradient = summation(pairs, sources, targets, matching, cut)
    if matching.normal_deviation > 0.0:
        # The parts of a turn together hear walls on all sides, each part alone perhaps one.
        turns = scans // matching.scan_parts
        information, gradient = discounted(information, gradient, turns, _PLACES, matching.normal_deviation)
    equations.add_blocks(_columns(scans, other_scans, layout), information, gradient)
    return len(pairs.rows)


def summed(
    pairs: Pairs, sources: PlacedPoints, targets: PlacedPoints, matching: SurfaceMatching, cut: float
) -> Tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return what the comparisons of each pair of scans say; see Summation."""
    residual, jacobian = linearised(pairs, sources, targets)
    weight = weights(residual, sources.slants[pairs.rows], targets.slants[pairs.neighbours], matching, cut)
    weight = weight * pairs.importance
    return _summed(sources.scans[pairs.rows], targets.scans[pairs.neighbours], residual, jacobian, weight)


def linearised(pairs: Pairs, sources: PlacedPoints, targets: PlacedPoints) -> Tuple[np.ndarray, np.ndarray]:
    """Return residuals (m,) [m] along the neighbours' normals, and their derivatives (m, 14).

    The columns are the poses of the source's two nodes, those of the target's two nodes, and the run's unknowns.
    Noise is one of the reported ranges. The residuals are therefore those per unit of range scale, which the
    derivative by it contains; else the fit would shrink the world to make them smaller.
    """
    i, j = pairs.rows, pairs.neighbours
    normals = targets.normals[j]
    residual = np.einsum("na,na->n", sources.places[i] - targets.places[j], normals)
    by_source, by_target = _by_pose(sources.arms[i], normals), -_by_pose(targets.arms[j], normals)
    late, later = sources.shares[i, np.newaxis], targets.shares[j, np.newaxis]
    by_run = np.einsum("nar,na->nr", sources.by_run[i] - targets.by_run[j], normals)
    by_run[:, RANGE_SCALE] -= residual
    parts = [(1.0 - late) * by_source, late * by_source, (1.0 - later) * by_target, later * by_target, by_run]
    return residual, np.concatenate(parts, axis=1)


def weights(
    residual: np.ndarray, slant: np.ndarray, other_slant: np.ndarray, matching: SurfaceMatching, cut: float
) -> np.ndarray:
    """Return the weights (m,) [1/m^2] of residuals whose points have slants (m,) [m].

    A beam that meets a surface aslant may have heard it anywhere in its width: such a point is less certain. The
    kernel is Geman and McClure's (1985), wider while the cut is.
    """
    variance = variances(slant, other_slant, matching)
    widening = max(1.0, cut / matching.cut)
    return matching.weight / variance / (1.0 + residual**2 / variance / widening**2) ** 2


def support(pairs: Pairs, sources: PlacedPoints, targets: PlacedPoints, matching: SurfaceMatching) -> float:
    """Return how much [nats] comparisons speak for the places of points: what the kernel leaves of each at most."""
    i, j = pairs.rows, pairs.neighbours
    residual = np.einsum("na,na->n", sources.places[i] - targets.places[j], targets.normals[j])
    ratio = residual**2 / variances(sources.slants[i], targets.slants[j], matching)
    return float(0.5 * matching.weight * (pairs.importance / (1.0 + ratio)).sum())


def variances(slant: np.ndarray, other_slant: np.ndarray, matching: SurfaceMatching) -> np.ndarray:
    """Return the variances (m,) [m^2] of residuals whose points have slants (m,) [m]."""
    return matching.range_deviation**2 + matching.beam_half_width**2 * (slant**2 + other_slant**2)


def _by_pose(arms: np.ndarray, normals: np.ndarray) -> np.ndarray:
    by_yaw = arms[:, 0] * normals[:, 1] - arms[:, 1] * normals[:, 0]
    return np.column_stack([normals, by_yaw])


def _summed(
    scans: np.ndarray,
    other_scans: np.ndarray,
    residual: np.ndarray,
    jacobian: np.ndarray,
    weight: np.ndarray,
) -> Tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return both scans, information and gradient of each pair of scans."""
    keys = scans * _MOST_SCANS + other_scans - BEFORE_THE_RUN
    order = np.argsort(keys, kind="stable")
    keys, jacobian = keys[order], jacobian[order]
    weighted = jacobian * weight[order, np.newaxis]
    bounds = np.concatenate([[0], np.flatnonzero(np.diff(keys)) + 1, [len(keys)]])
    gradient = np.add.reduceat(weighted * residual[order, np.newaxis], bounds[:-1], axis=0)
    information = np.empty((len(bounds) - 1, _PAIR_COLUMNS, _PAIR_COLUMNS))
    for group, (start, end) in enumerate(zip(bounds[:-1], bounds[1:])):
        np.dot(weighted[start:end].T, jacobian[start:end], out=information[group])
    first = keys[bounds[:-1]]
    return first // _MOST_SCANS, first % _MOST_SCANS + BEFORE_THE_RUN, information, gradient


def _columns(scans: np.ndarray, other_scans: np.ndarray, layout: Layout) -> np.ndarray:
    nodes = np.column_stack([scans, scans + 1, other_scans, other_scans + 1])
    poses = layout.pose_columns(nodes)
    run = np.broadcast_to(layout.run_start + np.arange(RUN_COLUMNS), (len(scans), RUN_COLUMNS))
    return np.concatenate([poses.reshape(len(scans), -1), run], axis=1)
