"""Looks for a vehicle whose sonar heard nothing for a while: what it hears now against the map.

The places are searched that the motion since then allows (correlative search, Olson 2009). The echoes must fit at one
of them, and at no other nearly as well; else it is better not to know where the vehicle is.
"""

from dataclasses import dataclass
from typing import List, Optional, Tuple

import numpy as np

from mlsm_manager.multi_view.islands import MAP, Islands
from mlsm_manager.multi_view.motion_search import cells, fits
from mlsm_manager.multi_view.odometry_model import OdometryModel
from mlsm_manager.multi_view.parameters import SurfaceMatching
from mlsm_manager.multi_view.placement import PlacedPoints, place
from mlsm_manager.multi_view.run_log import RunLog
from mlsm_manager.multi_view.state import POSE, State
from mlsm_manager.multi_view.transition import Transition

FEWEST_POINTS = 25
"""On surfaces, that a scan must hear to tell a place: fewer fit anywhere."""
_REACH = 3.0  # standard deviations of the motion within which is searched
_KNOWN = 2.0  # so many within the cut, and the solver's own steps do
_MOST_CELLS = 60  # on each side of the expected place
_MOST_POINTS = 60  # of the scan that are laid on each place; neighbours on a wall say the same
_FINE_POINTS = 150  # on each place that is looked at again
_MOST_PLACES = 8  # that are looked at again, with other motions within the scan
_OTHER = 4.0  # m from a place from which on it is another
_MOTIONS = np.linspace(-2.0, 2.0, 5)  # standard deviations of the motion within the scan that are tried, each way
_SHIFTS = np.array([-0.7, 0.0, 0.7])  # m by which the scan is moved besides
_FIT = 0.5  # share of the points that must lie on surfaces
_ISLAND_SCANS = 6  # the newest ones of an island that are looked for: older ones may lie in water that the map has not
_ISLAND_POINTS = 400  # of these
_LEAD = 0.1  # by which that share must exceed the one at any other place
_NATS = 0.1  # that a point on a surface is worth: neighbours share errors


@dataclass(frozen=True)
class Whereabouts:
    """What a search found. moves: (k, width) of the newest nodes to the best place.

    fit, elsewhere: shares of the points on surfaces there, and at the best other place. distance: m from the
    expected place. reach: m, deviation of that.
    """

    moves: np.ndarray
    fit: float
    elsewhere: float
    distance: float
    reach: float

    @property
    def is_certain(self) -> bool:
        """Whether the points fit there, and nowhere else."""
        return self.fit >= max(_FIT, self.elsewhere + _LEAD)

    def line(self) -> str:
        """Return it as one line for people."""
        return (
            f"{100 * self.fit:.0f} % of the echoes fit {self.distance:.1f} m beside the expected place, "
            f"{100 * self.elsewhere:.0f} % at another place within {_REACH * self.reach:.0f} m"
        )


def silent_scans(log: RunLog) -> int:
    """Return how many scans before the newest one heard too little to tell a place, one after the other."""
    scan = log.scan_count - 2
    while scan >= 0 and len(log.rows(scan, scan + 1)) < FEWEST_POINTS:
        scan -= 1
    return log.scan_count - 2 - scan


def whereabouts(
    log: RunLog,
    odometry: OdometryModel,
    state: State,
    islands: Islands,
    covariance: np.ndarray,
    silent: int,
    matching: SurfaceMatching,
) -> Optional[Whereabouts]:
    """Return where the newest scan was taken, after `silent` scans before it that heard nothing.

    covariance: (width, width) of the node before these. None where the motion since is known well enough, or the scan
    hears too little itself.
    """
    last = log.scan_count
    motion = _Motion(log, odometry, state, covariance, silent)
    own = log.rows(last - 1, last)
    if motion.reach * _KNOWN < matching.cut or len(own) < FEWEST_POINTS:
        return None
    sources = place(log, odometry, state, own[:: max(1, len(own) // _FINE_POINTS)])
    targets = _map_around(log, odometry, state, islands, sources, _REACH * motion.reach + matching.cut)
    if not len(targets):
        return Whereabouts(np.zeros((0, odometry.width)), 0.0, 0.0, 0.0, motion.reach)
    shifts = cells(motion.of_end, _MOST_CELLS)
    best = _best_places(sources, targets, shifts, motion.ends(shifts), matching)
    found = [_refined(motion, sources, targets, shift, matching) for shift in best]
    scores = [_NATS * share * sources.qualities.sum() - motion.cost(ends) for ends, share in found]
    best = int(np.argmax(scores))
    ends, fit = found[best]
    others = [share for other, share in found if np.hypot(*(other - ends)[2:]) > _OTHER]
    return Whereabouts(motion.moves(ends), fit, max(others, default=0.0), float(np.hypot(*ends[2:])), motion.reach)


def island_place(
    log: RunLog,
    odometry: OdometryModel,
    state: State,
    islands: Islands,
    covariance: np.ndarray,
    matching: SurfaceMatching,
) -> Whereabouts:
    """Return where the newest scans, which lie apart from the map, are in it; covariance: (2, 2) m^2 of the place.

    They are moved together, with the nodes of the silence before them in part.
    """
    last, first = log.scan_count, islands.start
    reach = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    rows = log.rows(max(first, last - _ISLAND_SCANS), last)
    sources = place(log, odometry, state, rows[:: max(1, len(rows) // _ISLAND_POINTS)])
    targets = _map_around(log, odometry, state, islands, sources, _REACH * reach + matching.cut)
    if not len(targets):
        return Whereabouts(np.zeros((0, odometry.width)), 0.0, 0.0, 0.0, reach)
    shifts = cells(covariance, _MOST_CELLS)
    best = np.array(_best_places(sources, targets, shifts, np.tile(shifts, 2), matching))
    around = best[:, np.newaxis] + _grid(_SHIFTS)
    moved = _moved(sources, np.tile(around.reshape(-1, 2), 2))
    shares = fits(sources, targets, moved, matching).reshape(around.shape[:2]) / sources.qualities.sum()
    finest = np.argmax(shares, axis=1)
    best, shares = around[np.arange(len(best)), finest], shares.max(axis=1)
    costs = 0.5 * np.einsum("na,nb,ab->n", best, best, np.linalg.inv(covariance))
    number = int(np.argmax(_NATS * shares * sources.qualities.sum() - costs))
    others = shares[np.hypot(*(best - best[number]).T) > _OTHER]
    moves = _island_moves(log, first, best[number], odometry.width)
    return Whereabouts(
        moves, float(shares[number]), float(others.max(initial=0.0)), float(np.hypot(*best[number])), reach
    )


def _island_moves(log: RunLog, first: int, shift: np.ndarray, width: int) -> np.ndarray:
    """Return the moves (k, width) of the newest nodes where the scans from `first` on are moved by `shift` (2,)."""
    silent = 0
    while first - silent > 0 and len(log.rows(first - silent - 1, first - silent)) < FEWEST_POINTS:
        silent += 1
    moves = np.zeros((log.scan_count - first + 1 + silent, width))
    moves[:, :2] = shift
    if silent:
        times = log.node_times[first - silent : first + 1]
        moves[:silent, :2] *= ((times[1:] - times[0]) / (times[-1] - times[0]))[:, np.newaxis]
    return moves


def _map_around(
    log: RunLog, odometry: OdometryModel, state: State, islands: Islands, sources: PlacedPoints, reach: float
) -> PlacedPoints:
    """Return the points of the map that `sources` can meet if they are moved by up to `reach` [m]."""
    scans = np.flatnonzero(islands.numbers == MAP)
    rows = [log.rows(scan, scan + 1) for scan in scans if scan != sources.scans[-1]]
    targets = place(log, odometry, state, np.concatenate([np.empty(0, dtype=np.int64), *rows]))
    low, high = sources.places.min(axis=0) - reach, sources.places.max(axis=0) + reach
    return targets.selected(((targets.places >= low) & (targets.places <= high)).all(axis=1))


def _grid(line: np.ndarray) -> np.ndarray:
    """Return the points (n, 2) of a square grid."""
    return np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)


class _Motion:
    """What is known of the nodes since the last scan that told a place, seen from there; the newest two matter most."""

    def __init__(self, log: RunLog, odometry: OdometryModel, state: State, covariance: np.ndarray, silent: int) -> None:
        last, self._width = log.scan_count, odometry.width
        first = last - 1 - silent
        steps = [
            Transition.of(odometry, state.nodes[node : node + 2], log.node_motion(np.array([node, node + 1])))
            for node in range(first, last)
        ]
        joint = _joint_covariance(steps, covariance)
        self._count = len(steps)
        end = self._width * (self._count - 1) + np.arange(2)
        start = end - self._width if self._count > 1 else np.empty(0, dtype=int)
        self._ends = np.append(start, end)
        self._of_ends = joint[np.ix_(self._ends, self._ends)]
        self._gain = joint[:, self._ends] @ np.linalg.inv(self._of_ends)
        self.of_end = joint[np.ix_(end, end)]
        self.reach = float(np.sqrt(np.linalg.eigvalsh(self.of_end)[-1]))
        self._along = joint[np.ix_(start, end)] @ np.linalg.inv(self.of_end)
        self._beside = joint[np.ix_(start, start)] - self._along @ joint[np.ix_(end, start)]

    def __len__(self) -> int:
        return self._count

    def ends(self, shifts: np.ndarray) -> np.ndarray:
        """Return the moves (k, 4) of beginning and end of the scan that are expected if its end moves by (k, 2)."""
        start = shifts @ self._along.T if len(self._along) else np.zeros_like(shifts)
        return np.column_stack([start, shifts])

    def freedom(self) -> np.ndarray:
        """Return moves (k, 2) of the scan's beginning beside the expected ones, that are to be tried."""
        if not len(self._beside):
            return np.zeros((1, 2))
        factor = np.linalg.cholesky(self._beside + 1e-6 * np.eye(2))
        grid = _grid(_MOTIONS)
        return grid[np.hypot(*grid.T) <= _MOTIONS.max()] @ factor.T

    def cost(self, ends: np.ndarray) -> float:
        """Return how unlikely moves (4,) of the scan's beginning and end are, nats."""
        known = ends[-len(self._ends) :]
        return 0.5 * float(known @ np.linalg.solve(self._of_ends, known))

    def moves(self, ends: np.ndarray) -> np.ndarray:
        """Return the moves (n, width) of the nodes that go with moves (4,) of the scan's beginning and end."""
        return (self._gain @ ends[-len(self._ends) :]).reshape(self._count, self._width)


def _joint_covariance(steps: List[Transition], covariance: np.ndarray) -> np.ndarray:
    """Return that of the nodes (n width, n width) after n `steps` from a node whose pose is taken as known."""
    width = len(covariance)
    joint = np.zeros((len(steps) * width,) * 2)
    own = covariance.copy()
    own[POSE] = own[:, POSE] = 0.0
    for number, step in enumerate(steps):
        before, here = slice(0, number * width), slice(number * width, (number + 1) * width)
        if number:
            joint[here, before] = step.matrix @ joint[(number - 1) * width : number * width, before]
            joint[before, here] = joint[here, before].T
        own = step.matrix @ own @ step.matrix.T + step.noise
        joint[here, here] = own
    return joint


def _moved(sources: PlacedPoints, ends: np.ndarray) -> np.ndarray:
    """Return the places (k, n, 2) of points whose scan begins and ends `ends` (k, 4) beside where they are."""
    share = sources.shares[:, np.newaxis]
    return sources.places + (1.0 - share) * ends[:, np.newaxis, :2] + share * ends[:, np.newaxis, 2:]


def _best_places(
    sources: PlacedPoints, targets: PlacedPoints, shifts: np.ndarray, ends: np.ndarray, matching: SurfaceMatching
) -> List[np.ndarray]:
    """Return those of `shifts` (k, 2) at which the points fit best, each another place; ends: (k, 4), see _moved."""
    few = sources.selected(np.arange(0, len(sources), max(1, len(sources) // _MOST_POINTS)))
    shares = fits(few, targets, _moved(few, ends), matching)
    found: List[np.ndarray] = []
    for index in np.argsort(-shares, kind="stable"):
        if all(np.hypot(*(shifts[index] - other)) > _OTHER / 2.0 for other in found):
            found.append(shifts[index])
        if len(found) == _MOST_PLACES:
            break
    return found


def _refined(
    motion: _Motion, sources: PlacedPoints, targets: PlacedPoints, shift: np.ndarray, matching: SurfaceMatching
) -> Tuple[np.ndarray, float]:
    """Return the best moves (4,) of beginning and end of the scan about a shift (2,) of both, and the share there."""
    shifts, freedom = shift + _grid(_SHIFTS), motion.freedom()
    ends = np.repeat(motion.ends(shifts), len(freedom), axis=0)
    ends[:, :2] += np.tile(freedom, (len(shifts), 1))
    shares = fits(sources, targets, _moved(sources, ends), matching) / sources.qualities.sum()
    best = int(np.argmax(shares))
    return ends[best], float(shares[best])
