"""Residuals of points against the surfaces that other scans heard, as normal equations."""

from typing import Tuple

import numpy as np

from mlsm_manager.joint_solver.compare.association import Pairs
from mlsm_manager.joint_solver.compare.normal_errors import discounted
from mlsm_manager.joint_solver.compiled.compiled_sums import POINT_COLUMNS, summed_comparisons
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placing.placement import PlacedPoints
from mlsm_manager.joint_solver.unknowns.normal_equations import NormalEquations
from mlsm_manager.joint_solver.unknowns.state import POSE_COLUMNS, RUN_COLUMNS, Layout

_PLACES = POSE_COLUMNS * np.arange(4)[:, np.newaxis] + np.arange(2)  # columns of x and y of a pair's nodes


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
    equations.add_blocks(_columns(scans, other_scans, layout), information, gradient)
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
    packed = _packed(sources)
    return summed_comparisons(
        pairs.rows, pairs.neighbours, pairs.importance,
        packed, sources.scans, packed if targets is sources else _packed(targets), targets.scans,
        parameters.echo_deviation**2, parameters.beam_half_width**2, parameters.weight, max(1.0, cut / parameters.cut),
    )  # fmt: skip


def _packed(points: PlacedPoints) -> np.ndarray:
    """Return points as rows (n, POINT_COLUMNS) of the compiled loops."""
    rows = np.empty((len(points), POINT_COLUMNS))
    rows[:, 0:2], rows[:, 2:4], rows[:, 4:6] = points.places, points.arms, points.normals
    rows[:, 6], rows[:, 7], rows[:, 8:12] = points.slants, points.shares, points.by_run.reshape(-1, 4)
    return rows


def support(pairs: Pairs, sources: PlacedPoints, targets: PlacedPoints, parameters: SolverParameters) -> float:
    """Return how much [nats] comparisons speak for the places of points: what the kernel leaves of each at most."""
    i, j = pairs.rows, pairs.neighbours
    residual = np.einsum("na,na->n", sources.places[i] - targets.places[j], targets.normals[j])
    ratio = residual**2 / parameters.variances(sources.slants[i], targets.slants[j])
    return float(0.5 * parameters.weight * (pairs.importance / (1.0 + ratio)).sum())


def _columns(scans: np.ndarray, other_scans: np.ndarray, layout: Layout) -> np.ndarray:
    nodes = np.column_stack([scans, scans + 1, other_scans, other_scans + 1])
    poses = layout.pose_columns(nodes)
    run = np.broadcast_to(layout.run_start + np.arange(RUN_COLUMNS), (len(scans), RUN_COLUMNS))
    return np.concatenate([poses.reshape(len(scans), -1), run], axis=1)
