"""Looks for a vehicle whose sonar heard nothing for a while: what it hears now against the map.

The places are searched that the motion since then allows (correlative search, Olson 2009). The echoes must fit at one
of them, and at no other nearly as well; else it is better not to know where the vehicle is.
"""

from dataclasses import dataclass
from typing import List, Optional, Tuple

import numpy as np

from mlsm_manager.joint_solver.compare.islands import MAP, Islands
from mlsm_manager.joint_solver.compare.known_surfaces import KnownSurfaces
from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.motion.odometry_model import OdometryModel
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placing.placement import PlacedPoints, place
from mlsm_manager.joint_solver.search.motion_search import cells, fits
from mlsm_manager.joint_solver.search.motion_since import MotionSince, grid
from mlsm_manager.joint_solver.unknowns.state import State

FEWEST_POINTS = 25
"""On surfaces, that a scan must hear to tell a place: fewer fit anywhere."""
_REACH = 3.0  # standard deviations of the motion within which is searched
_KNOWN = 2.0  # so many within the cut, and the solver's own steps do
_MOST_CELLS = 60  # on each side of the expected place
_MOST_POINTS = 60  # of the scan that are laid on each place; neighbours on a wall say the same
_FINE_POINTS = 150  # on each place that is looked at again
_MOST_PLACES = 8  # that are looked at again, with other motions within the scan
_OTHER = 4.0  # m from a place from which on it is another
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
    parameters: SolverParameters,
    known: Optional[KnownSurfaces] = None,
) -> Optional[Whereabouts]:
    """Return where the newest scan was taken, after `silent` scans before it that heard nothing.

    covariance: (width, width) of the node before these. known: what was in the map before the run. None where the
    motion since is known well enough, or the scan hears too little itself.
    """
    last = log.scan_count
    motion = MotionSince(log, odometry, state, covariance, silent)
    own = log.rows(last - 1, last)
    if motion.reach * _KNOWN < parameters.cut or len(own) < FEWEST_POINTS:
        return None
    sources = place(log, odometry, state, own[:: max(1, len(own) // _FINE_POINTS)])
    targets = _map_around(log, odometry, state, islands, sources, _REACH * motion.reach + parameters.cut, known)
    if not len(targets):
        return Whereabouts(np.zeros((0, odometry.width)), 0.0, 0.0, 0.0, motion.reach)
    shifts = cells(motion.of_end, _MOST_CELLS)
    likely = _best_places(sources, targets, shifts, motion.ends(shifts), parameters)
    found = [_refined(motion, sources, targets, shift, parameters) for shift in likely]
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
    parameters: SolverParameters,
    known: Optional[KnownSurfaces] = None,
) -> Whereabouts:
    """Return where the newest scans, which lie apart from the map, are in it; covariance: (2, 2) m^2 of the place.

    They are moved together, with the nodes of the silence before them in part. known: what was in the map before the
    run.
    """
    last, first = log.scan_count, islands.start
    reach = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    rows = log.rows(max(first, last - _ISLAND_SCANS), last)
    sources = place(log, odometry, state, rows[:: max(1, len(rows) // _ISLAND_POINTS)])
    targets = _map_around(log, odometry, state, islands, sources, _REACH * reach + parameters.cut, known)
    if not len(sources) or not len(targets):
        return Whereabouts(np.zeros((0, odometry.width)), 0.0, 0.0, 0.0, reach)
    shifts = cells(covariance, _MOST_CELLS)
    best = np.array(_best_places(sources, targets, shifts, np.tile(shifts, 2), parameters))
    around = best[:, np.newaxis] + grid(_SHIFTS)
    moved = _moved(sources, np.tile(around.reshape(-1, 2), 2))
    shares = fits(sources, targets, moved, parameters).reshape(around.shape[:2]) / sources.qualities.sum()
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
    log: RunLog, odometry: OdometryModel, state: State, islands: Islands, sources: PlacedPoints, reach: float,
    known: Optional[KnownSurfaces],
) -> PlacedPoints:  # fmt: skip
    """Return the points of the map that `sources` can meet if they are moved by up to `reach` [m]."""
    if not len(sources):
        return sources
    scans = np.flatnonzero(islands.numbers == MAP)
    rows = [log.rows(scan, scan + 1) for scan in scans if scan != sources.scans[-1]]
    targets = place(log, odometry, state, np.concatenate([np.empty(0, dtype=np.int64), *rows]))
    low, high = sources.places.min(axis=0) - reach, sources.places.max(axis=0) + reach
    targets = targets.selected(((targets.places >= low) & (targets.places <= high)).all(axis=1))
    return targets if known is None else targets.joined_with(known.around(low, high))


def _moved(sources: PlacedPoints, ends: np.ndarray) -> np.ndarray:
    """Return the places (k, n, 2) of points whose scan begins and ends `ends` (k, 4) beside where they are."""
    share = sources.shares[:, np.newaxis]
    return sources.places + (1.0 - share) * ends[:, np.newaxis, :2] + share * ends[:, np.newaxis, 2:]


def _best_places(
    sources: PlacedPoints, targets: PlacedPoints, shifts: np.ndarray, ends: np.ndarray, parameters: SolverParameters
) -> List[np.ndarray]:
    """Return those of `shifts` (k, 2) at which the points fit best, each another place; ends: (k, 4), see _moved."""
    few = sources.selected(np.arange(0, len(sources), max(1, len(sources) // _MOST_POINTS)))
    shares = fits(few, targets, _moved(few, ends), parameters)
    found: List[np.ndarray] = []
    for index in np.argsort(-shares, kind="stable"):
        if all(np.hypot(*(shifts[index] - other)) > _OTHER / 2.0 for other in found):
            found.append(shifts[index])
        if len(found) == _MOST_PLACES:
            break
    return found


def _refined(
    motion: MotionSince, sources: PlacedPoints, targets: PlacedPoints, shift: np.ndarray, parameters: SolverParameters
) -> Tuple[np.ndarray, float]:
    """Return the best moves (4,) of beginning and end of the scan about a shift (2,) of both, and the share there."""
    shifts, freedom = shift + grid(_SHIFTS), motion.freedom()
    ends = np.repeat(motion.ends(shifts), len(freedom), axis=0)
    ends[:, :2] += np.tile(freedom, (len(shifts), 1))
    shares = fits(sources, targets, _moved(sources, ends), parameters) / sources.qualities.sum()
    best = int(np.argmax(shares))
    return ends[best], float(shares[best])
