"""Compares echoes that stand alone with those of other scans, along the line of sight and across it."""

from dataclasses import replace
from typing import Iterator, Optional, Tuple

import numpy as np

from mlsm_manager.joint_solver.comparisons import Neighbours, add_comparisons
from mlsm_manager.joint_solver.compiled_comparisons import Pairs
from mlsm_manager.joint_solver.normal_equations import Layout, NormalEquations
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.joint_solver.surface_points import ramp

_NEAR_IN_TIME = 5  # turns before and after, a minute, in which a vehicle passes a post
_CONFIRMED = (1.0, 3.0)  # of them that heard a point too: from clutter, met by chance, to something that stays
_FADING = 0.8  # share of the cut from which on a pair fades out, so that none appears at once


class PostComparisons:
    """Comparisons of echoes of posts in free scans with those of all others in view."""

    def __init__(self, solution: Solution, scans: np.ndarray, importance: np.ndarray) -> None:
        """scans: (s,) those in view, ascending. importance: (s,) factors of what is compared with them."""
        confidence = solution.parameters.post_confidence
        scans, importance = (scans, importance) if confidence else (scans[:0], importance[:0])
        rows = [solution.log.posts.rows(scan, scan + 1) for scan in scans]
        self._rows = np.concatenate([np.empty(0, dtype=np.int64), *rows])
        self._importance = confidence * np.repeat(importance, [len(own) for own in rows])
        self._parameters = replace(solution.parameters, normal_deviation=0.0) if confidence else solution.parameters
        self._lists: Optional[Neighbours] = None

    def add(self, equations: NormalEquations, layout: Layout, solution: Solution, cut: float) -> int:
        """Add the comparisons of points of free scans; return how many there are."""
        if not self._importance.any():
            return 0
        points = solution.placed_posts(self._rows)
        sources = points.selected(points.scans >= layout.first)
        if self._lists is None:
            self._lists = Neighbours(points, self._parameters.group_scans)
        near = _NEAR_IN_TIME * self._parameters.parts_per_turn
        pairs, count = post_pairs(self._lists, sources, points, cut, near), 0
        pairs = pairs.weighted(self._importance)
        for each, heard, met in along_and_across(pairs, sources, points):
            count += add_comparisons(equations, layout, each, heard, met, self._parameters, cut)
        return count


def post_pairs(
    lists: Neighbours, sources: PlacedPoints, targets: PlacedPoints, cut: float, near_in_time: int = _NEAR_IN_TIME
) -> Pairs:
    """Return the comparisons of all `sources` with their nearest neighbours in each group of `targets`.

    A point counts if several of the `near_in_time` scans before and after its own heard one there too. Clutter meets
    clutter by chance, and would say that nothing moves.
    """
    rows, neighbours, distance, shares = lists.within(sources, targets, cut)
    met = shares * ramp(distance, cut, _FADING * cut) * targets.qualities[neighbours]
    near = np.abs(sources.scans[rows] - targets.scans[neighbours]) <= near_in_time
    confirmed = ramp(np.bincount(rows, met * near, len(sources)), *_CONFIRMED)
    importance = met * sources.qualities[rows] * confirmed[rows]
    kept = importance > 0.0
    return Pairs(rows[kept], neighbours[kept], importance[kept])


def along_and_across(
    pairs: Pairs, sources: PlacedPoints, targets: PlacedPoints
) -> Iterator[Tuple[Pairs, PlacedPoints, PlacedPoints]]:
    """Yield the comparisons along the sources' lines of sight, and those across, as such with surfaces.

    Along, a point is as certain as its range; across, it may be anywhere in its beam: its slant is its range.
    """
    i, j = pairs.rows, pairs.neighbours
    each = Pairs(np.arange(len(i)), np.arange(len(i)), pairs.importance)
    heard, met = sources.selected(i), targets.selected(j)
    for axis in (heard.normals, np.column_stack([-heard.normals[:, 1], heard.normals[:, 0]])):
        yield (
            each,
            replace(heard, slants=_slants(heard.arms, axis)),
            replace(met, normals=axis, slants=_slants(met.arms, axis)),
        )


def _slants(arms: np.ndarray, axis: np.ndarray) -> np.ndarray:
    return np.abs(arms[:, 0] * axis[:, 1] - arms[:, 1] * axis[:, 0])
