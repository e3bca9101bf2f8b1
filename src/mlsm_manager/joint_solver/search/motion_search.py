"""Looks for the newest node where the solver's own steps do not reach, because the motion is hardly known."""

from typing import NamedTuple, Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.joint_solver.compare.map_support import map_support, nearness
from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.motion.motion_models import OdometryModel, Transition
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placing.placement import PlacedPoints, place, place_lone
from mlsm_manager.joint_solver.search.places import (
    MOST_POINTS,
    NATS,
    REACH,
    moved,
    places_within,
)
from mlsm_manager.joint_solver.unknowns.state import YAW, State

_KNOWN = 2.0  # deviations of the motion within the cut, and the solver's own steps do
_MOST_CELLS = 12  # on each side of the expected place; bounds the time of a search to a fraction of a second
_COMPARED_SCANS = 10  # before the newest: a few minutes, in which a vehicle sees the same
_LONE_NATS = 1.0  # that a point which stands alone is worth where another one stood: there are few
_FEW_POINTS = 50  # of it, while many turns are compared
_KNOWN_TURN = 0.1  # rad, deviation: the solver's own steps find turns of less than twice as much
_TURN_CELL = 0.08  # rad: moves an echo 20 m away by less than twice a cell
_LEAST_LEFT = 1e-6  # rad^2: of the heading, once a turn is chosen


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
    last = log.scan_count
    nodes = np.array([last - 1, last])
    step = Transition.of(odometry, state.nodes[nodes], log.node_motion(nodes)).step_covariance(covariance)
    if _KNOWN * np.sqrt(np.linalg.eigvalsh(step[:2, :2])[-1]) < parameters.cut:
        return newest
    before, own = log.rows(min(max(first, last - 1 - _COMPARED_SCANS), last - 1), last - 1), log.rows(last - 1, last)
    if not len(before) or not len(own):
        return newest
    search = _Search(log, odometry, parameters, place(log, odometry, state, before), own)
    if np.sqrt(step[YAW, YAW]) > _KNOWN_TURN:
        state, step = search.turned(state, step)
    return search.beside(state, step, MOST_POINTS)[1]


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
        shifts = places_within(step[:2, :2], _MOST_CELLS)
        ends = np.column_stack([np.zeros_like(shifts), shifts])
        found = NATS * MOST_POINTS / most * map_support(sources, self.targets, moved(sources, ends), parameters)
        if parameters.post_confidence:
            found = found + parameters.post_confidence * _LONE_NATS * _lone_fits(log, odometry, state, ends, parameters)
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
        states, told = [], []
        for turn in _TURN_CELL * np.arange(-count, count + 1):
            candidate = state.copy()
            candidate.nodes[-1] += by_yaw * turn
            states.append(candidate)
            told.append(self.beside(candidate, left, _FEW_POINTS)[0] - 0.5 * (turn / deviation) ** 2)
        return states[int(np.argmax(told))], left


def _lone_fits(
    log: RunLog, odometry: OdometryModel, state: State, ends: np.ndarray, parameters: SolverParameters
) -> np.ndarray:
    """Return how many of the newest scan's lone points (k,) lie on earlier ones at `ends` (k, 4); see moved."""
    last = log.scan_count
    sources = place_lone(log, odometry, state, log.lone.rows(last - 1, last))
    targets = place_lone(log, odometry, state, log.lone.rows(max(0, last - 1 - _COMPARED_SCANS), last - 1))
    if not len(sources) or not len(targets):
        return np.zeros(len(ends))
    places = moved(sources, ends)
    distance, _ = cKDTree(targets.places).query(places.reshape(-1, 2), distance_upper_bound=parameters.cut)
    return (nearness(distance).reshape(places.shape[:2]) * sources.qualities).sum(axis=1)
