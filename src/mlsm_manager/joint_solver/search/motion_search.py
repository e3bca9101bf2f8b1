"""Looks for the newest node where the solver's own steps do not reach, because the motion is hardly known."""

from typing import NamedTuple, Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.motion.odometry_model import OdometryModel
from mlsm_manager.joint_solver.motion.transition import Transition
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placing.placement import PlacedPoints, place, place_lone
from mlsm_manager.joint_solver.unknowns.state import BEFORE_THE_RUN, YAW, State

_REACH = 3.0  # standard deviations of the step within which is searched
_KNOWN = 2.0  # so many within the cut, and the solver's own steps do
_MOST_CELLS = 12  # on each side of the expected place; bounds the time of a search to a fraction of a second
_CELL = 1.0  # m: about twice the deviation of an echo, so that no place falls between two cells
COMPARED_SCANS = 10  # before the newest: a few minutes, in which a vehicle sees the same
_MOST_POINTS = 150  # of the newest scan; neighbours on a wall say the same
_LONE_NATS = 1.0  # that a point which stands alone is worth where another one stood: there are few
_FEW_POINTS = 50  # of it, while many turns are compared
_KNOWN_TURN = 0.1  # rad, deviation: the solver's own steps find turns of less than twice as much
_TURN_CELL = 0.08  # rad: moves an echo 20 m away by less than twice a cell
_LEAST_LEFT = 1e-6  # rad^2: of the heading, once a turn is chosen
_NATS = 0.1  # that a point on a surface is worth: neighbours share errors


def searched_node(
    log: RunLog,
    odometry: OdometryModel,
    state: State,
    covariance: np.ndarray,
    parameters: SolverParameters,
    first: int = 0,
) -> np.ndarray:
    """Return the newest node (width,), moved to where its scan fits best what the scans before it heard.

    first: the oldest scan that it is compared with. covariance: (width, width) of the node before it. Where the motion
    is known well the node stays as it is. A place far from the expected one must fit better by what the motion's
    covariance asks (correlative search, Olson 2009).
    """
    newest = state.nodes[-1]
    step = step_covariance(log, odometry, state, covariance, 1)
    if is_known(step, parameters):
        return newest
    last = log.scan_count
    before, own = log.rows(min(max(first, last - 1 - COMPARED_SCANS), last - 1), last - 1), log.rows(last - 1, last)
    if not len(before) or not len(own):
        return newest
    search = _Search(log, odometry, parameters, place(log, odometry, state, before), own)
    if np.sqrt(step[YAW, YAW]) > _KNOWN_TURN:
        state, step = search.turned(state, step)
    return search.beside(state, step, _MOST_POINTS)[1]


class _Search(NamedTuple):
    """What the newest scan is compared with. targets: of earlier scans. own: (n,) rows of the newest scan's points."""

    log: RunLog
    odometry: OdometryModel
    parameters: SolverParameters
    targets: PlacedPoints
    own: np.ndarray

    def beside(self, state: State, step: np.ndarray, most: int) -> Tuple[float, np.ndarray]:
        """Return the newest node (width,) at the best place near its own, and what speaks for it [nats].

        step: covariance (width, width) of the node. most: points of the scan that are compared.
        """
        log, odometry, parameters = self.log, self.odometry, self.parameters
        sources = place(log, odometry, state, self.own[:: max(1, len(self.own) // most)])
        shifts = cells(step[:2, :2], _MOST_CELLS)
        found = _NATS * _MOST_POINTS / most * fits(sources, self.targets, _moved(sources, shifts), parameters)
        if parameters.post_confidence:
            found = found + parameters.post_confidence * _LONE_NATS * _lone_fits(
                log, odometry, state, shifts, parameters
            )
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
        count = int(np.ceil(_REACH * deviation / _TURN_CELL))
        states, told = [], []
        for turn in _TURN_CELL * np.arange(-count, count + 1):
            candidate = state.copy()
            candidate.nodes[-1] += by_yaw * turn
            states.append(candidate)
            told.append(self.beside(candidate, left, _FEW_POINTS)[0] - 0.5 * (turn / deviation) ** 2)
        return states[int(np.argmax(told))], left


def step_covariance(
    log: RunLog, odometry: OdometryModel, state: State, covariance: np.ndarray, count: int
) -> np.ndarray:
    """Return that (width, width) of the newest node as seen from the pose of the node `count` before it.

    covariance: (width, width) of that node.
    """
    ends = np.array([log.scan_count - count, log.scan_count])
    return Transition.of(odometry, state.nodes[ends], log.node_motion(ends)).step_covariance(covariance)


def is_known(step: np.ndarray, parameters: SolverParameters) -> bool:
    """Return whether the solver's own steps reach as far as a motion with covariance `step` (width, width) may go."""
    return _KNOWN * np.sqrt(np.linalg.eigvalsh(step[:2, :2])[-1]) < parameters.cut


def _moved(sources: PlacedPoints, shifts: np.ndarray) -> np.ndarray:
    """Return the places (k, n, 2) of n points of the newest scan where its node is moved by `shifts` (k, 2)."""
    return sources.places + sources.shares[:, np.newaxis] * shifts[:, np.newaxis]


def _lone_fits(
    log: RunLog, odometry: OdometryModel, state: State, shifts: np.ndarray, parameters: SolverParameters
) -> np.ndarray:
    """Return how many of the newest scan's lone points (k,) lie on earlier ones at `shifts` (k, 2)."""
    last = log.scan_count
    sources = place_lone(log, odometry, state, log.lone.rows(last - 1, last))
    targets = place_lone(log, odometry, state, log.lone.rows(max(0, last - 1 - COMPARED_SCANS), last - 1))
    if not len(sources) or not len(targets):
        return np.zeros(len(shifts))
    moved = _moved(sources, shifts)
    distance, _ = cKDTree(targets.places).query(moved.reshape(-1, 2), distance_upper_bound=parameters.cut)
    near = np.exp(-0.5 * (distance / _CELL) ** 2).reshape(moved.shape[:2])
    return (near * sources.qualities).sum(axis=1)


def cells(covariance: np.ndarray, most: int) -> np.ndarray:
    """Return shifts (n, 2) [m] that cover the ellipse of a covariance (2, 2); the first one is none.

    They are a cell apart; farther where there would be more than `most` on each side.
    """
    reach = _REACH * np.sqrt(np.diag(covariance))
    cell = max(_CELL, float(reach.max()) / most)
    x, y = (cell * np.arange(-np.floor(one / cell), np.floor(one / cell) + 1.0) for one in reach)
    shifts = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    distance = np.einsum("na,nb,ab->n", shifts, shifts, np.linalg.inv(covariance))
    return np.concatenate([np.zeros((1, 2)), shifts[distance <= _REACH**2]])


def fits(sources: PlacedPoints, targets: PlacedPoints, moved: np.ndarray, parameters: SolverParameters) -> np.ndarray:
    """Return how many points (k,) lie on surfaces when they are `moved` to places (k, n, 2); nearly counts in part.

    Surfaces from before the run do not say from which side they were heard.
    """
    distance, index = cKDTree(targets.places).query(moved.reshape(-1, 2), distance_upper_bound=parameters.cut)
    found = np.isfinite(distance)
    index = np.where(found, index, 0).reshape(moved.shape[:2])
    cosine = np.einsum("na,kna->kn", sources.normals, targets.normals[index])
    cosine = np.where((targets.scans == BEFORE_THE_RUN)[index], np.abs(cosine), cosine)
    near = np.exp(-0.5 * np.where(found, distance / _CELL, np.inf) ** 2).reshape(cosine.shape)
    return (near * sources.qualities * (cosine > parameters.min_cosine)).sum(axis=1)
