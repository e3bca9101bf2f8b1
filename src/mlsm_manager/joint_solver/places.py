"""One search over places, for all who ask where scans lie on what other scans heard (correlative search, Olson 2009).

Every place within reach is tried with few points, the best ones again with all and a little aside. A place is certain
if the points fit there, and at no other place nearly as well.

It is used where the solver's own steps do not reach. A scan whose motion is hardly known is laid on the scans before
it. After a silence of the sonar it is sought in the whole map, at the places that the motion since then allows; if the
echoes do not fit at one of them alone, it is better not to know where the vehicle is.
"""

from dataclasses import dataclass
from typing import List, NamedTuple, Optional, Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.joint_solver.map_support import Surfaces, nearness
from mlsm_manager.joint_solver.normal_equations import POSE, RUN_COLUMNS, YAW, NormalEquations, State
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.solution import MAP, Solution
from node_support.geometry import grid

FEWEST_POINTS = 25  # on surfaces, that a scan must hear to tell a place: fewer fit anywhere
REACH = 3.0  # standard deviations of the place within which is searched
MOST_POINTS = 150  # of one scan, that are laid on each place; neighbours on a wall say the same
_POINT_WEIGHT = 0.1  # log-likelihood of a point on a surface: neighbours share errors
_FEW_POINTS = 60  # of the scans, where all places are tried
_CELL = 1.0  # m: about twice the deviation of an echo, so that no place falls between two cells
_MOST_CELLS = 60  # on each side of the expected place
_MOST_PLACES = 8  # that are looked at again
_ASIDE = np.array([-0.7, 0.0, 0.7])  # m by which the scans are moved then
_OTHER = 4.0  # m from a place from which on it is another
_FIT = 0.5  # share of the points that must lie on surfaces
_LEAD = 0.1  # by which that share must exceed the one at any other place


@dataclass(frozen=True)
class PlaceCandidate:
    """shift: (2,) m from the expected place to the best one that a search found. reach: m, deviation of the place.

    fit, fit_before, elsewhere: shares of the points on surfaces there, at the expected place, and at the best other
    one.
    """

    shift: np.ndarray
    fit: float
    fit_before: float
    elsewhere: float
    reach: float

    @property
    def is_certain(self) -> bool:
        """Whether the points fit there, and nowhere else."""
        return self.fit >= max(_FIT, self.elsewhere + _LEAD)

    def line(self) -> str:
        return (
            f"{100 * self.fit:.0f} % of the echoes fit {np.hypot(*self.shift):.1f} m beside the expected place, "
            f"{100 * self.elsewhere:.0f} % at another place within {REACH * self.reach:.0f} m"
        )


def thinned(rows: np.ndarray, most: int) -> np.ndarray:
    """Return about `most` of the rows, evenly."""
    return rows[:: max(1, len(rows) // most)]


def best_place(covariance: np.ndarray, sources: PlacedPoints, surfaces: Surfaces) -> PlaceCandidate:
    """Return where `sources`, moved as one, fit best to `surfaces`; nowhere, with a fit of 0, without either.

    covariance: (2, 2) m^2, of their place. Every place within reach is tried with few points, the best ones again with
    all and a little aside.
    """
    reach = _widest(covariance)
    if not len(sources) or not len(surfaces.points):
        return PlaceCandidate(np.zeros(2), 0.0, 0.0, 0.0, reach)
    shifts = _places_within(covariance, _MOST_CELLS)
    few = sources.selected(thinned(np.arange(len(sources)), _FEW_POINTS))
    shares = surfaces.shares(few, few.places + shifts[:, np.newaxis])
    found = [_refined(sources, surfaces, shift) for shift in _best_of(shifts, shares)]
    total, information = sources.qualities.sum(), np.linalg.inv(covariance)
    likelihoods = [_POINT_WEIGHT * share * total - 0.5 * shift @ information @ shift for shift, share in found]
    best, fit = found[int(np.argmax(likelihoods))]
    others = [share for shift, share in found if np.hypot(*(shift - best)) > _OTHER]
    return PlaceCandidate(best, fit, float(shares[0]), max(others, default=0.0), reach)


def _widest(covariance: np.ndarray) -> float:
    """Return the largest deviation [m] of a place with a covariance (2, 2) [m^2]."""
    return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))


def _places_within(covariance: np.ndarray, most: int) -> np.ndarray:
    """Return shifts (n, 2) [m] that cover the ellipse of a covariance (2, 2), none first; `most` on each side."""
    reach = REACH * np.sqrt(np.diag(covariance))
    cell = max(_CELL, float(reach.max()) / most)
    x, y = (cell * np.arange(-np.floor(one / cell), np.floor(one / cell) + 1.0) for one in reach)
    shifts = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    distance = np.einsum("na,nb,ab->n", shifts, shifts, np.linalg.inv(covariance))
    return np.concatenate([np.zeros((1, 2)), shifts[distance <= REACH**2]])


def _best_of(shifts: np.ndarray, shares: np.ndarray) -> List[np.ndarray]:
    """Return those of `shifts` (k, 2) with the greatest shares (k,), each another place."""
    found: List[np.ndarray] = []
    for index in np.argsort(-shares, kind="stable"):
        if all(np.hypot(*(shifts[index] - other)) > _OTHER / 2.0 for other in found):
            found.append(shifts[index])
        if len(found) == _MOST_PLACES:
            break
    return found


def _refined(sources: PlacedPoints, surfaces: Surfaces, shift: np.ndarray) -> Tuple[np.ndarray, float]:
    """Return the best shift (2,) of the scans about one, and the share there."""
    shifts = shift + grid(_ASIDE)
    shares = surfaces.shares(sources, sources.places + shifts[:, np.newaxis])
    best = int(np.argmax(shares))
    return shifts[best], float(shares[best])


_KNOWN = 2.0  # deviations of the motion within the cut, and the solver's own steps do
_SUBMAP_SCANS = 6  # the newest ones of a submap that are looked for: older ones may lie in water that the map has not
_SUBMAP_POINTS = 400  # of these
_MOST_CELLS_BESIDE = 12  # on each side of the expected place; bounds the time of a search to a fraction of a second
_COMPARED_SCANS = 10  # before the newest: a few minutes, in which a vehicle sees the same
_POST_WEIGHT = 1.0  # log-likelihood of a point that stands alone where another one stood: there are few
_FEW_POINTS_OF_TURNS = 50  # of it, while many turns are compared
_KNOWN_TURN = 0.1  # rad, deviation: the solver's own steps find turns of less than twice as much
_TURN_CELL = 0.08  # rad: moves an echo 20 m away by less than twice a cell
_LEAST_LEFT = 1e-6  # rad^2: of the heading, once a turn is chosen


def put_newest(solution: Solution, covariance: np.ndarray, silent: int) -> Optional[PlaceCandidate]:
    """Put the newest nodes where their scans fit, if the motion is hardly known; or let them begin a submap.

    covariance: of the node before the newest scan and the `silent` scans before that, and of the run's unknowns. Return
    what came of the search in the whole map; None where none was needed.
    """
    covariance = covariance[:-RUN_COLUMNS, :-RUN_COLUMNS]
    found = _place_after_silence(solution, covariance, silent) if silent else None
    if found is not None and found.is_certain and not solution.submaps.is_apart:
        _move_newest(solution, solution.log.scan_count - 1, found.shift)
    elif found is not None and found.reach > solution.parameters.wide_cut:
        solution.submaps.begin()
    else:
        solution.state.nodes[-1] = searched_node(solution, covariance, solution.submaps.start)
    return found


def searched_node(solution: Solution, covariance: np.ndarray, first: int = 0) -> np.ndarray:
    """Return the newest node (width,), moved to where its scan fits best what the scans before it heard.

    first: the oldest scan that it is compared with. covariance: (width, width) of the node before it. Where the motion
    is known well the node stays as it is. A place far from the expected one must fit better by what the motion's
    covariance asks (correlative search, Olson 2009).
    """
    log, state, newest = solution.log, solution.state, solution.state.nodes[-1]
    last, step = log.scan_count, covariance_since(solution, covariance, 0)
    if _KNOWN * _widest(step[:2, :2]) < solution.parameters.cut:
        return newest
    before = log.surfaces.rows(min(max(first, last - 1 - _COMPARED_SCANS), last - 1), last - 1)
    own = log.surfaces.rows(last - 1, last)
    if not len(before) or not len(own):
        return newest
    targets = solution.placed(log.surfaces.points(before))
    search = _Search(solution, Surfaces(targets, solution.parameters), own)
    if np.sqrt(step[YAW, YAW]) > _KNOWN_TURN:
        state, step = search.turned(state, step)
    return search.beside(state, step, MOST_POINTS)[1]


def _place_after_silence(solution: Solution, covariance: np.ndarray, silent: int) -> Optional[PlaceCandidate]:
    """Return where the newest scan was taken, after `silent` scans before it that heard nothing.

    covariance: (width, width) of the node before these. None where the motion since is known well enough, or the scan
    hears too little itself.
    """
    last = solution.log.scan_count
    own, place = solution.log.surfaces.rows(last - 1, last), covariance_since(solution, covariance, silent)[:2, :2]
    if _widest(place) * _KNOWN < solution.parameters.cut or len(own) < FEWEST_POINTS:
        return None
    return _best_place(solution, thinned(own, MOST_POINTS), place)


def put_submap(solution: Solution, covariance: np.ndarray) -> PlaceCandidate:
    """Put the newest scans, which lie apart from the map, into it if they fit at one place; return what was found.

    They are moved together, with the nodes of the silence before them in part. covariance: (2, 2) m^2 of the place.
    """
    log = solution.log
    last, first = log.scan_count, solution.submaps.start
    rows = log.surfaces.rows(max(first, last - _SUBMAP_SCANS), last)
    found = _best_place(solution, thinned(rows, _SUBMAP_POINTS), covariance)
    if found.is_certain:
        _move_newest(solution, first, found.shift)
        solution.submaps.join()
    return found


def _best_place(solution: Solution, rows: np.ndarray, covariance: np.ndarray) -> PlaceCandidate:
    """Return where in the map the points in `rows` fit best."""
    sources = solution.placed(solution.log.surfaces.points(rows))
    targets = _map_around(solution, sources, REACH * _widest(covariance) + solution.parameters.cut)
    return best_place(covariance, sources, Surfaces(targets, solution.parameters))


class _Search(NamedTuple):
    """What the newest scan is compared with. own: (n,) rows of its points. surfaces: those of earlier scans."""

    solution: Solution
    surfaces: Surfaces
    own: np.ndarray

    def beside(self, state: State, step: np.ndarray, most: int) -> Tuple[float, np.ndarray]:
        """Return the newest node (width,) at the best place near its own, and its log-likelihood.

        step: covariance (width, width) of the node. most: points of the scan that are compared.
        """
        solution, parameters = self.solution.with_state(state), self.solution.parameters
        sources = solution.placed(solution.log.surfaces.points(thinned(self.own, most)))
        shifts = _places_within(step[:2, :2], _MOST_CELLS_BESIDE)
        support = self.surfaces.support(sources, _with_ends_moved(sources, shifts))
        found = _POINT_WEIGHT * MOST_POINTS / most * support
        if parameters.post_confidence:
            found = found + parameters.post_confidence * _POST_WEIGHT * _post_support(solution, shifts)
        costs = 0.5 * np.einsum("na,nb,ab->n", shifts, shifts, np.linalg.inv(step[:2, :2]))
        best = np.argmax(found - costs)
        node = state.nodes[-1] + step[:, :2] @ np.linalg.solve(step[:2, :2], shifts[best])
        return float((found - costs)[best]), node

    def turned(self, state: State, step: np.ndarray) -> Tuple[State, np.ndarray]:
        """Return the state whose newest node is turned as its scan fits best, and what is open then of `step`."""
        deviation = np.sqrt(step[YAW, YAW])
        by_yaw = step[:, YAW] / step[YAW, YAW]
        left = step - np.outer(by_yaw, step[YAW])
        left[YAW, YAW] = max(left[YAW, YAW], _LEAST_LEFT)
        count = int(np.ceil(REACH * deviation / _TURN_CELL))
        states, scores = [], []
        for turn in _TURN_CELL * np.arange(-count, count + 1):
            candidate = state.copy()
            candidate.nodes[-1] += by_yaw * turn
            states.append(candidate)
            scores.append(self.beside(candidate, left, _FEW_POINTS_OF_TURNS)[0] - 0.5 * (turn / deviation) ** 2)
        return states[int(np.argmax(scores))], left


def _with_ends_moved(sources: PlacedPoints, shifts: np.ndarray) -> np.ndarray:
    """Return the places (k, n, 2) of points whose scan ends `shifts` (k, 2) beside where it does, and begins there."""
    return sources.places + sources.shares[:, np.newaxis] * shifts[:, np.newaxis]


def _post_support(solution: Solution, shifts: np.ndarray) -> np.ndarray:
    """Return how many of the newest scan's echoes of posts (k,) lie on earlier ones; see _with_ends_moved."""
    last, posts = solution.log.scan_count, solution.log.posts
    of_scans = (last - 1, last), (max(0, last - 1 - _COMPARED_SCANS), last - 1)
    sources, targets = (solution.placed(posts.heard(*each)) for each in of_scans)
    if not len(sources) or not len(targets):
        return np.zeros(len(shifts))
    places = _with_ends_moved(sources, shifts)
    distance, _ = cKDTree(targets.places).query(places.reshape(-1, 2), distance_upper_bound=solution.parameters.cut)
    return (nearness(distance).reshape(places.shape[:2]) * sources.qualities).sum(axis=1)


def covariance_since(solution: Solution, covariance: np.ndarray, silent: int) -> np.ndarray:
    """Return that of the newest node (width, width) as seen from the one before it and `silent` scans.

    covariance: (width, width) of that node.
    """
    log, model, own = solution.log, solution.parameters.odometry, covariance.copy()
    here, there = slice(0, model.width), slice(model.width, 2 * model.width)
    own[POSE] = own[:, POSE] = 0.0
    for node in range(log.scan_count - 1 - silent, log.scan_count):
        equations = NormalEquations(2 * model.width)
        motion = log.node_motion(np.array([node, node + 1]))
        equations.add(*model.steps(solution.state.nodes[node : node + 2], motion))
        information, _ = equations.dense()
        noise = np.linalg.inv(information[there, there])
        step = -noise @ information[there, here]
        own = step @ own @ step.T + noise
    return own


def silent_before(log: RunLog, scan: int) -> int:
    """Return how many scans before `scan` heard too little to tell a place, one after the other."""
    heard = np.flatnonzero(log.surfaces.counts[:scan] >= FEWEST_POINTS)
    return scan - 1 - int(heard[-1]) if len(heard) else scan


def _move_newest(solution: Solution, first: int, shift: np.ndarray) -> None:
    """Move the nodes of the scans from `first` on by `shift` (2,) [m], and those of a silence before them in part."""
    silent = silent_before(solution.log, first)
    times = solution.log.node_times[first - silent :]
    shares = np.minimum((times[1:] - times[0]) / (times[silent] - times[0]), 1.0)
    solution.state.nodes[-len(shares) :, :2] += np.outer(shares, shift)


def _map_around(solution: Solution, sources: PlacedPoints, reach: float) -> PlacedPoints:
    """Return the points of the map that `sources` can meet if they are moved by up to `reach` [m]."""
    if not len(sources):
        return sources
    scans = np.flatnonzero(solution.submaps.numbers == MAP)
    rows, _ = solution.log.surfaces.rows_of(scans[scans != sources.scans[-1]])
    targets = solution.placed(solution.log.surfaces.points(rows))
    low, high = sources.places.min(axis=0) - reach, sources.places.max(axis=0) + reach
    targets = targets.selected(((targets.places >= low) & (targets.places <= high)).all(axis=1))
    return targets if solution.known is None else targets.joined_with(solution.known.around(low, high))
