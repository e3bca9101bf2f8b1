"""Loops while a run goes on: a place heard before is looked for, and the path since then bends to it.

The frozen past moves by what its stated covariance expects (the errors of a random walk), which needs no solution of
the whole run: nodes that were as certain as the older visit stay, and what was lost since then is given back.
"""

from dataclasses import dataclass
from typing import List, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.loops import APART, NEIGHBOURS, Loop, agreed, loop_of, reach_of
from mlsm_manager.joint_solver.normal_equations import State
from mlsm_manager.joint_solver.places import FEWEST_POINTS, MOST_POINTS
from mlsm_manager.joint_solver.solution import MAP, Solution

_EVERY = 3  # scans of which one is looked at, and the next ones too where it has a loop
_LANDMARK_DISTANCE = 3.0  # m between places of older scans that are looked at: nearer ones heard the same
_MOST_LANDMARKS = 60  # nearest ones; bounds the time of a search to some tens of milliseconds
_TRIED = (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0)
_HELD = 0.01  # m, deviation of a path that lost nothing


def with_newest(solution: Solution, before: Sequence[Loop]) -> Tuple[Loop, ...]:
    """Return the loops found `before` that the newest scan may confirm, and its own where it has one."""
    scan, parameters = solution.log.scan_count - 1, solution.parameters
    kept = tuple(loop for loop in before if loop.scan >= scan - NEIGHBOURS)
    own = solution.log.rows(scan, scan + 1)
    in_turn = scan % _EVERY == 0 or len(kept) > 0
    if not in_turn or scan < APART or len(own) < FEWEST_POINTS:
        return kept
    sources = solution.placed(own[:: max(1, len(own) // MOST_POINTS)])
    rows = [solution.log.rows(one, one + 1) for one in _landmarks(solution, *reach_of(sources))]
    older = solution.placed(np.concatenate([np.empty(0, dtype=np.int64), *rows]))
    loop = loop_of(sources, older, scan, parameters) if len(older) else None
    return kept if loop is None else (*kept, loop)


def confirmed(loops: Sequence[Loop], scan: int) -> List[Loop]:
    """Return those of the newest `loops` that agree with each other, if that of `scan`, the newest one, is of them."""
    found = agreed(loops)
    return found if found and found[-1].scan == scan else []


def _landmarks(solution: Solution, middle: np.ndarray, radius: float) -> np.ndarray:
    """Return older scans (n,), ascending, whose ends lie within `radius` [m] of `middle` (2,) and apart."""
    last = solution.log.scan_count - APART
    scans = np.flatnonzero((solution.submaps.numbers[:last] == MAP) & (solution.log.point_counts[:last] > 0))
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
        return _TRIED if self.lost.any() else _TRIED[:1]

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


@dataclass(frozen=True)
class ClosedLoop:
    """A loop that the path went over to. seconds: since the place was heard before. shift: (2,) m, of the end."""

    seconds: float
    shift: np.ndarray
    gain: float

    def line(self) -> str:
        """Return it as one line for people."""
        return f"found a place heard {self.seconds:.0f} s ago again: moved by {np.hypot(*self.shift):.1f} m"
