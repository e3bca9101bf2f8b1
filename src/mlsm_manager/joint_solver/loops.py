"""Places visited again, far from where the odometry says: found by their shape, kept only if the run speaks for them.

A scan is laid over what much older scans heard, at all places around its own. A place counts when it is certain, fits
much better than the present one, and neighbouring scans agree.
"""

from dataclasses import dataclass
from typing import List, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.map_support import Surfaces
from mlsm_manager.joint_solver.normal_equations import Layout, NormalEquations, State
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.places import FEWEST_POINTS, MOST_POINTS, REACH, Freedom, PlaceCandidate, best_place
from mlsm_manager.joint_solver.solution import Solution

APART = 20
"""Scans: newer ones are compared anyway, and tie a scan to where it is."""
_DRIFT = 5.0  # m, deviation: of a scan against one that is so much older
_GAIN = 0.25  # by which the share of points on surfaces must exceed the one at the present place
_SAME = 1.0  # m: so near to a scan's points lie those of the older one that it lies on
_ALIKE = 2.5  # m by which neighbouring scans may differ
NEIGHBOURS = 3
"""Scans before and after that are asked, and how many, the scan included, must agree."""
_DEVIATION = 0.5  # m: of a place that is found


@dataclass(frozen=True)
class Loop:
    """A scan that lies on what the scan `older` heard, once it is moved against that one to a `place`."""

    scan: int
    older: int
    place: PlaceCandidate

    def line(self) -> str:
        """Return it as one line for people."""
        return (
            f"scan {self.scan + 1} lies on what scan {self.older + 1} heard, {np.hypot(*self.place.shift):.1f} m "
            f"beside its place: {100 * self.place.fit:.0f} % of its echoes fit there, "
            f"{100 * self.place.fit_before:.0f} % before, {100 * self.place.elsewhere:.0f} % elsewhere"
        )


def loops_of(solution: Solution) -> List[Loop]:
    """Return the places visited again that neighbouring scans agree on, in the order of time.

    None where turns are cut into parts: a part hears too little to be told from others.
    """
    log, parameters = solution.log, solution.parameters
    if parameters.parts_per_turn > 1:
        return []
    points = solution.placed(log.rows(0, log.scan_count))
    found = [_loop(points, scan, parameters) for scan in range(APART, log.scan_count)]
    return agreed([loop for loop in found if loop is not None])


def agreed(loops: Sequence[Loop]) -> List[Loop]:
    """Return those of `loops` (one per scan at most) that enough neighbouring scans confirm."""
    return [loop for loop in loops if sum(_confirms(other, loop) for other in loops) >= NEIGHBOURS]


def add_loops(
    equations: NormalEquations, layout: Layout, loops: Sequence[Loop], nodes: np.ndarray, start: State
) -> None:
    """Add that the scans of `loops` are moved by their shifts against `start`, in which these were found.

    nodes: (n, width) as they are now.
    """
    if not loops:
        return
    ends = np.array([[loop.scan + 1, loop.older + 1] for loop in loops])
    columns = layout.pose_columns(ends)
    shifts = np.array([loop.place.shift for loop in loops])
    for axis in (0, 1):
        now, then = (some[ends[:, 0], axis] - some[ends[:, 1], axis] for some in (nodes, start.nodes))
        jacobian = np.tile([1.0, -1.0], (len(loops), 1))
        weight = np.full(len(loops), _DEVIATION**-2.0)
        equations.add(columns[:, :, axis], jacobian, now - then - shifts[:, axis], weight)


def _confirms(other: Loop, loop: Loop) -> bool:
    near = np.hypot(*(other.place.shift - loop.place.shift)) <= _ALIKE
    return abs(other.scan - loop.scan) <= NEIGHBOURS and near


def _loop(points: PlacedPoints, scan: int, parameters: SolverParameters) -> Optional[Loop]:
    own = np.flatnonzero(points.scans == scan)
    if len(own) < FEWEST_POINTS:
        return None
    sources = points.selected(own[:: max(1, len(own) // MOST_POINTS)])
    return loop_of(sources, points.selected(points.scans <= scan - APART), scan, parameters)


def reach_of(sources: PlacedPoints) -> Tuple[np.ndarray, float]:
    """Return the middle (2,) of a scan's points, and how far from it [m] they may lie once the scan is moved."""
    return sources.places.mean(axis=0), float(np.ptp(sources.places, axis=0).max() + REACH * _DRIFT)


def loop_of(sources: PlacedPoints, older: PlacedPoints, scan: int, parameters: SolverParameters) -> Optional[Loop]:
    """Return where the points of a scan lie on `older` ones, if that is certain and far from where they are."""
    middle, radius = reach_of(sources)
    targets = older.selected(np.abs(older.places - middle).max(axis=1) < radius)
    surfaces = Surfaces(targets, parameters)
    if not len(targets) or surfaces.shares(sources, sources.places[np.newaxis])[0] > 1.0 - _GAIN:
        return None
    found = best_place(Freedom.as_one(_DRIFT**2 * np.eye(2), np.ones(1), 2), sources, surfaces)
    if not found.is_certain or found.fit < found.fit_before + _GAIN:
        return None
    distance = np.hypot(*(targets.places[:, np.newaxis] - sources.places - found.shift).transpose(2, 0, 1)).min(axis=1)
    return Loop(scan, int(np.median(targets.scans[distance < _SAME])), found)
