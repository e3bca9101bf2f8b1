"""How far scans lie on the surfaces that other scans heard, and what that tells of errors the solver cannot know."""

from dataclasses import dataclass
from typing import Sequence, Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.joint_solver.comparisons import Comparison
from mlsm_manager.joint_solver.estimate import misfit_covariance
from mlsm_manager.joint_solver.normal_equations import BEFORE_THE_RUN
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.solution import Solution

_CELL = 1.0  # m: about twice the deviation of an echo
_SURROUNDINGS = 8.0  # m around a point within which surfaces may be the one that it lies on, or lie beside it
_CANDIDATES = 24  # points heard before that are looked at for each point: enough to find one that faces the same way
_FEWEST_POINTS = 2.0  # points with surfaces around them: fewer tell nothing
_TURNS_BEFORE = 10  # a few minutes, in which a vehicle sees the same
_FITS = 0.65  # share of a turn's points on what was heard before from which on it fits; as in self_check.scans_go_on
_UNSETTLED_TURNS = 5  # a run's first scans correct each other, and a scan may be put right by the next ones
_SPEED = 0.5  # m/s: the usual speed of a small vehicle; nothing else tells how far it went
_ON_PLANE = 1.0  # deviations within which a point lies on the plane of the one that it is compared with


class Surfaces:
    """Points on surfaces, among which others look for the nearest one that faces the same way.

    Surfaces from before the run do not say from which side they were heard.
    """

    def __init__(self, points: PlacedPoints, parameters: SolverParameters) -> None:
        self.points, self._parameters = points, parameters
        self._tree, self._two_sided = cKDTree(points.places), points.scans == BEFORE_THE_RUN

    def shares(self, sources: PlacedPoints, places: np.ndarray) -> np.ndarray:
        """Return which share (k,) of n sources lies on surfaces where they are at `places` (k, n, 2); see `support`."""
        return self.support(sources, places) / sources.qualities.sum()

    def support(self, sources: PlacedPoints, places: np.ndarray) -> np.ndarray:
        """Return how many of n sources (k,) lie on surfaces where they are at `places` (k, n, 2).

        Each counts by its quality, and in part where it lies a little beside. Of each only the nearest target is
        looked at.
        """
        distance = self.distances(sources, places, self._parameters.cut, 1)
        return (nearness(distance) * sources.qualities).sum(axis=1)

    def distances(self, sources: PlacedPoints, places: np.ndarray, reach: float, candidates: int) -> np.ndarray:
        """Return how far (k, n) [m] n sources at `places` (k, n, 2) are from the nearest point that faces the same way.

        It is sought among so many `candidates`, the nearest points within `reach` [m]; infinity where none does.
        """
        shape = (*places.shape[:2], candidates)
        ranks = np.arange(1, candidates + 1)
        distance, index = self._tree.query(places.reshape(-1, 2), k=ranks, distance_upper_bound=reach)
        distance, index = distance.reshape(shape), index.reshape(shape)
        near = np.nonzero(np.isfinite(distance))
        met = index[near]
        cosine = np.einsum("na,na->n", sources.normals[near[1]], self.points.normals[met])
        cosine = np.where(self._two_sided[met], np.abs(cosine), cosine)
        distance[near] = np.where(cosine > self._parameters.min_cosine, distance[near], np.inf)
        return distance.min(axis=2)


def nearness(distance: np.ndarray) -> np.ndarray:
    """Return how far points count as lying on what is `distance` [m] away: 1 on it, 0 far off."""
    return np.exp(-0.5 * (distance / _CELL) ** 2)


def shares_heard_before(solution: Solution, first: int) -> np.ndarray:
    """Return which share (n,) of the points of turns `first` and newer lies on surfaces that those before heard.

    Only points count around which a surface was heard that faces the same way: others may be new. NaN for turns with
    hardly any such points. A turn is a scan, or all its parts.
    """
    turns = range(first, solution.log.scan_count // solution.parameters.parts_per_turn)
    return np.array([_share(solution, turn) for turn in turns])


def misfit_variances(solution: Solution, first: int) -> np.ndarray:
    """Return by how much (n,) [m^2] each of the turns `first` and newer makes the place of all that follows uncertain.

    In each direction. It is 0 for a turn that fits to those before it, and grows with the share of its points that
    should lie on what these heard and do not, up to as far as a vehicle goes in a turn. Where the odometry reports
    distances it is 0: a motion that is reported is not lost with a scan.
    """
    parts = solution.parameters.parts_per_turn
    times = solution.log.node_times[parts * first :: parts]
    if not np.isinf(solution.parameters.odometry.distance_deviation):
        return np.zeros(len(times) - 1)
    shares = shares_heard_before(solution, first)
    misfit = np.clip(1.0 - np.where(np.isfinite(shares), shares, _FITS) / _FITS, 0.0, 1.0)
    return misfit * (_SPEED * np.diff(times)) ** 2


@dataclass(frozen=True)
class FrozenPlaces:
    """How uncertain nodes are that stay where they were found.

    covariances: (f, 3, 3) of their poses. misfits: (n,) m^2, of the place, for each turn of the head.
    """

    covariances: np.ndarray
    misfits: np.ndarray

    def _until(self, nodes: int) -> np.ndarray:
        """Return the sum of the misfits of whole turns up to each node (nodes,) m^2; as the last one beyond them."""
        known = np.cumsum(np.append(0.0, self.misfits))
        return known[np.minimum(np.arange(nodes), len(known) - 1)]

    def places(self, count: int, following: np.ndarray) -> np.ndarray:
        """Return the covariances (count + k, 2, 2) of the first places, and of those with poses `following` them."""
        covariances = np.append(self.covariances[:count], following, axis=0)
        return (covariances + misfit_covariance(self._until(len(covariances))))[:, :2, :2]

    def better(self, left: np.ndarray) -> "FrozenPlaces":
        """Return them with only the share `left` (n,) of the variance of the first ones."""
        until, covariances = self._until(max(len(left), len(self.misfits)) + 1), self.covariances.copy()
        until[: len(left)] *= left
        covariances[: len(left)] *= left[:, np.newaxis, np.newaxis]
        return FrozenPlaces(covariances, np.diff(until)[: len(self.misfits)])


def misfits_with_newest(solution: Solution, misfits: np.ndarray) -> np.ndarray:
    """Return those of all turns (n,) m^2; the newest ones are judged where they are put now."""
    first = max(0, solution.log.scan_count // solution.parameters.parts_per_turn - _UNSETTLED_TURNS)
    return np.append(misfits[:first], misfit_variances(solution, first))


def agreement(met: Sequence[Comparison], scan: int, parameters: SolverParameters) -> Tuple[float, float, np.ndarray]:
    """Return the share of a scan's comparisons in which its point lies on its neighbour's surface, the mean distance
    [m] from it, and the sum (2, 2) of the outer products of these surfaces' normals; 0 without any.
    """
    near = weight = distance = 0.0
    surfaces = np.zeros((2, 2))
    for pairs, sources, targets in met:
        own = sources.scans[pairs.rows] == scan
        i, j = pairs.rows[own], pairs.neighbours[own]
        importance, normals = pairs.importance[own], targets.normals[j]
        residual = np.einsum("na,na->n", sources.places[i] - targets.places[j], normals)
        variance = parameters.variances(sources.slants[i], targets.slants[j])
        distance += float((importance * np.abs(residual)).sum())
        near += float(importance[residual**2 < _ON_PLANE**2 * variance].sum())
        weight += float(importance.sum())
        surfaces += np.einsum("n,na,nb->ab", importance, normals, normals)
    return (near / weight, distance / weight, surfaces) if weight else (0.0, 0.0, surfaces)


def _share(solution: Solution, turn: int) -> float:
    heard, parts = solution.log.surfaces, solution.parameters.parts_per_turn
    before = heard.rows(parts * max(0, turn - _TURNS_BEFORE), parts * turn)
    own = heard.rows(parts * turn, parts * (turn + 1))
    if not len(before) or not len(own):
        return np.nan
    sources, targets = (solution.placed(heard.points(rows)) for rows in (own, before))
    surfaces = Surfaces(targets, solution.parameters)
    distances = surfaces.distances(sources, sources.places[np.newaxis], _SURROUNDINGS, _CANDIDATES)[0]
    known = np.isfinite(distances)
    total = sources.qualities[known].sum()
    if total <= _FEWEST_POINTS:
        return np.nan
    return float(sources.qualities[known] @ nearness(distances[known]) / total)
