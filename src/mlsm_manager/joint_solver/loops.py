"""Places visited again, far from where the odometry says: found by their shape, kept only if the run speaks for them.

A scan is laid over what much older scans heard, at all places around its own. A place counts when it is certain, fits
much better than the present one, and neighbouring scans agree. While the run goes on, the frozen past then moves by
what its stated covariance expects (the errors of a random walk), which needs no solution of the whole run: nodes that
were as certain as the older visit stay, and what was lost since then is given back.
"""

from dataclasses import dataclass
from typing import Iterator, List, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.map_support import Surfaces
from mlsm_manager.joint_solver.normal_equations import Layout, Residuals, State, moves_between
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.places import FEWEST_POINTS, MOST_POINTS, REACH, PlaceCandidate, best_place, thinned
from mlsm_manager.joint_solver.solution import MAP, Solution

CONVINCING = 10.0  # of log likelihood, by which a run with loops must fit better
_APART = 20  # scans: newer ones are compared anyway, and tie a scan to where it is
_DRIFT = 5.0  # m, deviation: of a scan against one that is so much older
_GAIN = 0.25  # by which the share of points on surfaces must exceed the one at the present place
_SAME = 1.0  # m: so near to a scan's points lie those of the older one that it lies on
_ALIKE = 2.5  # m by which neighbouring scans may differ
_NEIGHBOURS = 3  # scans before and after that are asked, and how many, the scan included, must agree
_DEVIATION = 0.5  # m: of a place that is found


@dataclass(frozen=True)
class Loop:
    """A scan that lies on what the scan `older` heard, once it is moved against that one to a `place`."""

    scan: int
    older: int
    place: PlaceCandidate

    def line(self) -> str:
        return (
            f"scan {self.scan + 1} lies on what scan {self.older + 1} heard, {np.hypot(*self.place.shift):.1f} m "
            f"beside its place: {100 * self.place.fit:.0f} % of its echoes fit there, "
            f"{100 * self.place.fit_before:.0f} % before, {100 * self.place.elsewhere:.0f} % elsewhere"
        )


def loops_of(solution: Solution) -> List[Loop]:
    """Return the places visited again that neighbouring scans agree on, in the order of time.

    None where turns are cut into parts: a part hears too little to be told from others.
    """
    log, parameters, found = solution.log, solution.parameters, []
    if parameters.parts_per_turn > 1:
        return []
    points = solution.placed(log.surfaces.heard(0, log.scan_count))
    for scan in range(_APART, log.scan_count):
        own = np.flatnonzero(points.scans == scan)
        if len(own) >= FEWEST_POINTS:
            sources = points.selected(thinned(own, MOST_POINTS))
            found.append(_loop_of(sources, points.selected(points.scans <= scan - _APART), scan, parameters))
    return agreed([loop for loop in found if loop is not None])


def agreed(loops: Sequence[Loop]) -> List[Loop]:
    """Return those of `loops` (one per scan at most) that enough neighbouring scans confirm."""

    def confirms(other: Loop, loop: Loop) -> bool:
        near = np.hypot(*(other.place.shift - loop.place.shift)) <= _ALIKE
        return abs(other.scan - loop.scan) <= _NEIGHBOURS and near

    return [loop for loop in loops if sum(confirms(other, loop) for other in loops) >= _NEIGHBOURS]


def pulls_of(loops: Sequence[Loop], layout: Layout, nodes: np.ndarray, start: State) -> Iterator[Residuals]:
    """Return that the scans of `loops` are moved by their shifts against `start`, in which these were found.

    nodes: (n, width) as they are now.
    """
    ends = np.array([[loop.scan + 1, loop.older + 1] for loop in loops])
    now, then = (some[ends[:, 0], :2] - some[ends[:, 1], :2] for some in (nodes, start.nodes))
    return moves_between(layout, ends, now - then - np.array([loop.place.shift for loop in loops]), _DEVIATION)


def _reach_of(sources: PlacedPoints) -> Tuple[np.ndarray, float]:
    """Return the middle (2,) of a scan's points, and how far from it [m] they may lie once the scan is moved."""
    return sources.places.mean(axis=0), float(np.ptp(sources.places, axis=0).max() + REACH * _DRIFT)


def _loop_of(sources: PlacedPoints, older: PlacedPoints, scan: int, parameters: SolverParameters) -> Optional[Loop]:
    """Return where the points of a scan lie on `older` ones, if that is certain and far from where they are."""
    middle, radius = _reach_of(sources)
    targets = older.selected(np.abs(older.places - middle).max(axis=1) < radius)
    surfaces = Surfaces(targets, parameters)
    if not len(targets) or surfaces.shares(sources, sources.places[np.newaxis])[0] > 1.0 - _GAIN:
        return None
    found = best_place(_DRIFT**2 * np.eye(2), sources, surfaces)
    if not found.is_certain or found.fit < found.fit_before + _GAIN:
        return None
    distance = np.hypot(*(targets.places[:, np.newaxis] - sources.places - found.shift).transpose(2, 0, 1)).min(axis=1)
    return Loop(scan, int(np.median(targets.scans[distance < _SAME])), found)


_EVERY = 3  # scans of which one is looked at, and the next ones too where it has a loop
_LANDMARK_DISTANCE = 3.0  # m between places of older scans that are looked at: nearer ones heard the same
_MOST_LANDMARKS = 60  # nearest ones; bounds the time of a search to some tens of milliseconds
_HELD = 0.01  # m, deviation of a path that lost nothing


def with_newest(solution: Solution, before: Sequence[Loop]) -> Tuple[Loop, ...]:
    """Return the loops found `before` that the newest scan may confirm, and its own where it has one."""
    scan, parameters = solution.log.scan_count - 1, solution.parameters
    kept = tuple(loop for loop in before if loop.scan >= scan - _NEIGHBOURS)
    surfaces = solution.log.surfaces
    own = surfaces.rows(scan, scan + 1)
    in_turn = scan % _EVERY == 0 or len(kept) > 0
    if not in_turn or scan < _APART or len(own) < FEWEST_POINTS:
        return kept
    sources = solution.placed(surfaces.points(thinned(own, MOST_POINTS)))
    rows, _ = surfaces.rows_of(_landmarks(solution, *_reach_of(sources)))
    older = solution.placed(surfaces.points(rows))
    loop = _loop_of(sources, older, scan, parameters) if len(older) else None
    return kept if loop is None else (*kept, loop)


def confirmed(loops: Sequence[Loop], scan: int) -> List[Loop]:
    """Return those of the newest `loops` that agree with each other, if that of `scan`, the newest one, is of them."""
    found = agreed(loops)
    return found if found and found[-1].scan == scan else []


def _landmarks(solution: Solution, middle: np.ndarray, radius: float) -> np.ndarray:
    """Return older scans (n,), ascending, whose ends lie within `radius` [m] of `middle` (2,) and apart."""
    last = solution.log.scan_count - _APART
    scans = np.flatnonzero((solution.submaps.numbers[:last] == MAP) & (solution.log.surfaces.counts[:last] > 0))
    places = solution.node_places(scans + 1)
    distances = np.hypot(*(places - middle).T)
    left, chosen = np.flatnonzero(distances < radius), []
    while len(left):
        chosen.append(left[0])
        left = left[np.hypot(*(places[left] - places[left[0]]).T) >= _LANDMARK_DISTANCE]
    nearest = sorted(chosen, key=lambda one: distances[one])[:_MOST_LANDMARKS]
    return scans[np.sort(np.array(nearest, dtype=np.int64))]


@dataclass(frozen=True)
class Bend:
    """How the path before a window gives way to loops. shift: (2,) m, of the newest scans. loops: as found at `start`.

    shares: (n,) of the move of the oldest free node, that each node makes too. lost: (n,) m^2, variance of its place
    since the older visit. information: (2, 2) 1/m^2, of the oldest free node's place against the older visit.
    """

    loops: Sequence[Loop]
    start: State
    shift: np.ndarray
    shares: np.ndarray
    lost: np.ndarray
    information: np.ndarray

    @classmethod
    def of(cls, loops: Sequence[Loop], start: State, covariances: np.ndarray) -> "Bend":
        """Return that to `loops`; covariances: (f + 1, 2, 2) m^2 of the places of all nodes up to the oldest free one.

        A node shares with the free ones what was unknown at the most certain place between them: what comes after it
        was lost later, and a branch that led back was lost by itself.
        """
        older, oldest = int(np.median([loop.older for loop in loops])) + 1, len(covariances) - 1
        shift = np.mean([loop.place.shift for loop in loops], axis=0)
        shares, lost = np.ones(len(start.nodes)), np.zeros(len(start.nodes))
        information = np.full((2, 2), np.inf)
        if older < oldest:
            variances = np.trace(covariances, axis1=1, axis2=2)
            shared = np.minimum.accumulate(variances[::-1])[::-1]
            lost[: oldest + 1] = np.clip(shared - variances[older], 0.0, None) * (np.arange(oldest + 1) > older)
            lost[oldest:] = lost[oldest]
            since = np.clip((np.arange(len(lost)) - older) / (oldest - older), 0.0, 1.0)
            shares = (lost + _HELD**2 * since) / (lost[oldest] + _HELD**2)
            values, vectors = np.linalg.eigh(covariances[oldest] - covariances[older])
            information = (vectors / np.maximum(values, _HELD**2)) @ vectors.T
        return cls(loops, start, shift, shares, lost, information)

    @property
    def tried(self) -> Sequence[float]:
        """Shares of the shift that the oldest free node may make; what is left is lost within the window."""
        return (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0) if self.lost.any() else (0.0,)

    def state(self, share: float) -> State:
        """Return the start, bent by a `share` of the shift; the free nodes move as one."""
        state = self.start.copy()
        state.nodes[:, :2] += share * self.shares[:, np.newaxis] * self.shift
        return state

    def cost(self, share: float) -> float:
        """Return the negative log likelihood of a `share` of the shift, of the path before the window."""
        moved = share * self.shift
        return 0.5 * float(moved @ self.information @ moved) if share else 0.0

    def left(self, share: float, variances: np.ndarray) -> np.ndarray:
        """Return what share (f,) is left of `variances` (f,) [m^2] of the first places after a `share` of the shift."""
        known = share * (self.shares * self.lost)[: len(variances)]
        return 1.0 - known / np.maximum(variances, _HELD**2)
