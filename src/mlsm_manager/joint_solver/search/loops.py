"""Places visited again, far from where the odometry says: found by their shape, kept only if the run speaks for them.

A scan is laid over what much older scans heard, at all places around its own (correlative search, Olson 2009). A place
counts when it fits much better than the present one and than any other, and when neighbouring scans agree.
"""

from dataclasses import dataclass
from typing import List, Optional

import numpy as np

from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.motion.odometry_model import OdometryModel
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placing.placement import PlacedPoints, place
from mlsm_manager.joint_solver.search.motion_search import fits
from mlsm_manager.joint_solver.unknowns.normal_equations import NormalEquations
from mlsm_manager.joint_solver.unknowns.state import Layout, State

_APART = 20  # scans: newer ones are compared anyway, and tie a scan to where it is
_REACH = 15.0  # m around a scan that are searched: thrice a drift of 5 m
_CELL = 1.0  # m: as wide as a fit is told from the next
_MOST_POINTS = 40  # of a scan; neighbours on a wall say the same
_FEWEST_POINTS = 25  # that hear a surface: fewer fit anywhere
_FIT = 0.6  # share of the points that must lie on surfaces
_GAIN = 0.25  # by which that share must exceed the one at the present place
_LEAD = 0.1  # by which it must exceed the one at any other place
_OTHER = 4.0  # m from the best place from which on a place is another
_ALIKE = 2.5  # m by which neighbouring scans may differ
_NEIGHBOURS = 3  # scans before and after that are asked, and how many, the scan included, must agree
_DEVIATION = 0.5  # m: of a place that is found


@dataclass(frozen=True)
class Loop:
    """A scan that lies on what the scan `older` heard, once it is moved by `shift` (2,) [m] against that one.

    fit, fit_before, fit_elsewhere: shares of its points on surfaces there, at the present place, and at the best other.
    """

    scan: int
    older: int
    shift: np.ndarray
    fit: float
    fit_before: float
    fit_elsewhere: float

    def line(self) -> str:
        """Return it as one line for people."""
        return (
            f"scan {self.scan + 1} lies on what scan {self.older + 1} heard, {np.hypot(*self.shift):.1f} m beside its "
            f"place: {100 * self.fit:.0f} % of its echoes fit there, {100 * self.fit_before:.0f} % before, "
            f"{100 * self.fit_elsewhere:.0f} % elsewhere"
        )


def loops_of(log: RunLog, odometry: OdometryModel, state: State, parameters: SolverParameters) -> List[Loop]:
    """Return the places visited again that neighbouring scans agree on, in the order of time.

    None where turns are cut into parts: a part hears too little to be told from others.
    """
    if parameters.parts_per_turn > 1:
        return []
    points = place(log, odometry, state, log.rows(0, log.scan_count))
    shifts = _shifts()
    found = [_loop(points, scan, shifts, parameters) for scan in range(_APART, log.scan_count)]
    return agreed([loop for loop in found if loop is not None])


def agreed(loops: List[Loop]) -> List[Loop]:
    """Return those of `loops` (one per scan at most) that enough neighbouring scans confirm."""
    return [loop for loop in loops if sum(_confirms(other, loop) for other in loops) >= _NEIGHBOURS]


def add_loops(equations: NormalEquations, layout: Layout, loops: List[Loop], nodes: np.ndarray, start: State) -> None:
    """Add that the scans of `loops` are moved by their shifts against `start`, in which these were found.

    nodes: (n, width) as they are now.
    """
    if not loops:
        return
    ends = np.array([[loop.scan + 1, loop.older + 1] for loop in loops])
    columns = layout.pose_columns(ends)
    shifts = np.array([loop.shift for loop in loops])
    for axis in (0, 1):
        now, then = (some[ends[:, 0], axis] - some[ends[:, 1], axis] for some in (nodes, start.nodes))
        jacobian = np.tile([1.0, -1.0], (len(loops), 1))
        weight = np.full(len(loops), _DEVIATION**-2.0)
        equations.add(columns[:, :, axis], jacobian, now - then - shifts[:, axis], weight)


def _confirms(other: Loop, loop: Loop) -> bool:
    return abs(other.scan - loop.scan) <= _NEIGHBOURS and np.hypot(*(other.shift - loop.shift)) <= _ALIKE


def _shifts() -> np.ndarray:
    """Return places (k, 2) [m] in a circle, the first one is none."""
    line = np.arange(-_REACH, _REACH + _CELL / 2.0, _CELL)
    grid = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.concatenate([np.zeros((1, 2)), grid[np.hypot(*grid.T) <= _REACH]])


def _loop(points: PlacedPoints, scan: int, shifts: np.ndarray, parameters: SolverParameters) -> Optional[Loop]:
    own, older = np.flatnonzero(points.scans == scan), points.scans <= scan - _APART
    if len(own) < _FEWEST_POINTS:
        return None
    sources = points.selected(own[:: max(1, len(own) // _MOST_POINTS)])
    middle, radius = sources.places.mean(axis=0), np.ptp(sources.places, axis=0).max() + _REACH
    targets = points.selected(older & (np.abs(points.places - middle).max(axis=1) < radius))
    if not len(targets):
        return None
    moved = sources.places + shifts[:, np.newaxis]
    shares = fits(sources, targets, moved, parameters) / sources.qualities.sum()
    best = int(np.argmax(shares))
    elsewhere = float(shares[np.hypot(*(shifts - shifts[best]).T) > _OTHER].max())
    if shares[best] < max(_FIT, shares[0] + _GAIN, elsewhere + _LEAD):
        return None
    heard_by = targets.scans[np.hypot(*(targets.places[:, np.newaxis] - moved[best]).transpose(2, 0, 1)).min(1) < _CELL]
    return Loop(scan, int(np.median(heard_by)), shifts[best], float(shares[best]), float(shares[0]), elsewhere)
