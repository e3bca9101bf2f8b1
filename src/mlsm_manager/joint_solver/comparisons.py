"""Comparisons of points with surfaces and posts that other scans heard: which count, and what they say of the unknowns.

A point is compared with its nearest neighbours in every group of scans.
"""

from dataclasses import replace
from typing import Iterable, Iterator, List, Tuple

import numpy as np

from mlsm_manager.joint_solver.compiled_comparisons import POINT_COLUMNS, Pairs, summed_comparisons, weighed_pairs
from mlsm_manager.joint_solver.compiled_neighbours import shared_neighbours
from mlsm_manager.joint_solver.normal_equations import POSE_COLUMNS, RUN_COLUMNS, Layout, NormalEquations
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.run_log import PointTable
from mlsm_manager.joint_solver.surface_points import ramp, slants_of
from mlsm_manager.joint_solver.weak_directions import discounted

# m by which a neighbour may be farther than the nearest one and still count in part. Were it 0, the nearest one would
# be decided by the last bit where two are equally near; more would compare each point with more neighbours.
TIE = 0.05
FADING = 0.8  # share of the cut from which on a pair fades out, so that none appears at once
COSINE_FADING = 0.1  # the same for the cosine between normals, above the least one
_PLACES = POSE_COLUMNS * np.arange(4)[:, np.newaxis] + np.arange(2)  # columns of x and y of a pair's nodes
Comparison = Tuple[Pairs, PlacedPoints, PlacedPoints]
"""Pairs, with the points and the surfaces that they compare."""


def neighbours_of(sources: PlacedPoints, targets: PlacedPoints, cut: float, group_scans: int) -> Tuple[np.ndarray, ...]:
    """Return rows of sources, rows of their neighbours, distances [m] and shares, each (m,), up to `cut` [m].

    For each source and each group of so many scans these are the nearest targets of other scans, and their shares add
    up to 1. targets: ascending by scan. Raises ValueError for places that are not finite.
    """
    if not len(sources.scans) or not len(targets.scans):
        nothing = np.empty(0, dtype=np.int64)
        return nothing, nothing, np.empty(0), np.empty(0)
    for points in (sources, targets):
        if not np.isfinite(points.places).all():
            nowhere = np.count_nonzero(~np.isfinite(points.places).all(axis=1))
            raise ValueError(f"{nowhere} of {len(points)} points without a finite place")
    groups = targets.scans // group_scans
    numbers = np.cumsum(np.diff(groups, prepend=groups[:1]) != 0)
    arrays = sources.places, sources.scans, targets.places, targets.scans
    return shared_neighbours(*(np.ascontiguousarray(array) for array in arrays), numbers, cut, TIE)


def comparisons_of(
    sources: PlacedPoints, surfaces: Iterable[PlacedPoints], cut: float, group_scans: int, min_cosine: float
) -> List[Comparison]:
    """Return those of all `sources` with their nearest neighbours in each group of each set of `surfaces` that count.

    Points of one scan are never compared with each other, nor surfaces that face different ways. In its own group, a
    point is compared with the nearest one of another scan. Neighbours that are as near share the comparison.
    """
    met, limits = [], (cut, FADING * cut, min_cosine, min_cosine + COSINE_FADING)
    for targets in surfaces:
        own, others = ((np.ascontiguousarray(points.normals), points.qualities) for points in (sources, targets))
        found = neighbours_of(sources, targets, cut, group_scans)
        met.append((weighed_pairs(found, own, others, limits), sources, targets))
    return met


def weighted(pairs: Pairs, factors: np.ndarray) -> Pairs:
    """Return comparisons with their importance times the factor of their neighbour; factors: (k,)."""
    return pairs._replace(importance=pairs.importance * factors[pairs.neighbours])


def add_comparisons(
    equations: NormalEquations, layout: Layout, met: Iterable[Comparison], parameters: SolverParameters, cut: float
) -> None:
    """Add the distances of points from the surfaces that they are compared with."""
    met = [one for one in met if len(one[0].rows)]
    terms = []
    for pairs, sources, targets in met:
        scans, other_scans, information, gradient = summed(pairs, sources, targets, parameters, cut)
        if parameters.normal_deviation > 0.0:
            # The parts of a turn together hear walls on all sides, each part alone perhaps one.
            turns = scans // parameters.parts_per_turn
            information, gradient = discounted(information, gradient, turns, _PLACES, parameters.normal_deviation)
        terms.append((scans, other_scans, information, gradient))
    if terms:
        scans, other_scans, information, gradient = (np.concatenate(each) for each in zip(*terms))
        poses = layout.pose_columns(np.column_stack([scans, scans + 1, other_scans, other_scans + 1]))
        run = np.broadcast_to(layout.run_start + np.arange(RUN_COLUMNS), (len(scans), RUN_COLUMNS))
        columns = np.concatenate([poses.reshape(len(scans), -1), run], axis=1)
        equations.add_terms(columns, information, gradient)


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
    noise = (parameters.echo_deviation**2, parameters.beam_half_width**2, parameters.weight)
    return summed_comparisons(tuple(pairs), own, others, noise, widening)


def _packed(points: PlacedPoints) -> Tuple[np.ndarray, np.ndarray]:
    rows = np.empty((len(points.scans), POINT_COLUMNS))
    rows[:, 0:2], rows[:, 2:4], rows[:, 4:6] = points.places, points.arms, points.normals
    rows[:, 6], rows[:, 7], rows[:, 8:12] = points.slants, points.shares, points.by_run.reshape(-1, 4)
    return rows, points.scans


def support(pairs: Pairs, sources: PlacedPoints, targets: PlacedPoints, parameters: SolverParameters) -> float:
    """Return the log likelihood of the places of points by their comparisons: what the robust kernel leaves of each."""
    i, j = pairs.rows, pairs.neighbours
    residual = np.einsum("na,na->n", sources.places[i] - targets.places[j], targets.normals[j])
    ratio = residual**2 / parameters.variances(sources.slants[i], targets.slants[j])
    return float(0.5 * parameters.weight * (pairs.importance / (1.0 + ratio)).sum())


_NEAR_IN_TIME = 5  # turns before and after, a minute, in which a vehicle passes a post
_CONFIRMED = (1.0, 3.0)  # of them that heard a point too: from clutter, met by chance, to something that stays


class PostComparisons:
    """Comparisons of echoes that stand alone, as of posts, in free scans with those of all others in view.

    They are compared along the line of sight and across it. points: these echoes and the scan of each. compared: scans
    of those that were compared last.
    """

    def __init__(
        self, posts: PointTable, parameters: SolverParameters, scans: np.ndarray, importance: np.ndarray
    ) -> None:
        """scans: (s,) those in view, ascending. importance: (s,) factors of what is compared with them."""
        rows, counts = posts.rows_of(scans)
        self.points = posts.points(rows)
        self._importance = parameters.post_confidence * np.repeat(importance, counts)
        self._parameters = replace(parameters, normal_deviation=0.0)
        self.compared = np.empty(0, dtype=int)

    def add(self, equations: NormalEquations, layout: Layout, points: PlacedPoints, cut: float) -> None:
        """Add the comparisons of those of the `points` that free scans heard."""
        if not self._importance.any():
            return
        sources = points.selected(points.scans >= layout.first)
        found = neighbours_of(sources, points, cut, self._parameters.group_scans)
        near = _NEAR_IN_TIME * self._parameters.parts_per_turn
        pairs = weighted(_post_pairs(found, sources, points, cut, near), self._importance)
        self.compared = sources.scans[np.unique(pairs.rows)]
        add_comparisons(equations, layout, _along_and_across(pairs, sources, points), self._parameters, cut)


def _post_pairs(
    found: Tuple[np.ndarray, ...], sources: PlacedPoints, targets: PlacedPoints, cut: float, near_in_time: int
) -> Pairs:
    """Return the comparisons of all `sources` with what `neighbours_of` found for them among `targets`.

    A point counts if several of the `near_in_time` scans before and after its own heard one there too. Clutter meets
    clutter by chance, and would say that nothing moves.
    """
    rows, neighbours, distance, shares = found
    met = shares * ramp(distance, cut, FADING * cut) * targets.qualities[neighbours]
    near = np.abs(sources.scans[rows] - targets.scans[neighbours]) <= near_in_time
    confirmed = ramp(np.bincount(rows, met * near, len(sources)), *_CONFIRMED)
    importance = met * sources.qualities[rows] * confirmed[rows]
    kept = importance > 0.0
    return Pairs(rows[kept], neighbours[kept], importance[kept])


def _along_and_across(pairs: Pairs, sources: PlacedPoints, targets: PlacedPoints) -> Iterator[Comparison]:
    """Yield the comparisons along the sources' lines of sight, and those across, as such with surfaces.

    Along, a point is as certain as its range; across, it may be anywhere in its beam: its slant is its range.
    """
    i, j = pairs.rows, pairs.neighbours
    each = Pairs(np.arange(len(i)), np.arange(len(i)), pairs.importance)
    heard, met = sources.selected(i), targets.selected(j)
    for axis in (heard.normals, np.column_stack([-heard.normals[:, 1], heard.normals[:, 0]])):
        slants, met_slants = (slants_of(points.arms, axis) for points in (heard, met))
        yield each, replace(heard, slants=slants), replace(met, normals=axis, slants=met_slants)
