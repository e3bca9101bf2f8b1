"""Fits of a run that believe its odometry less, or another one."""

from dataclasses import dataclass, replace
from typing import Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.batch_solver import QuickFit
from mlsm_manager.joint_solver.motion_models import SCALE
from mlsm_manager.joint_solver.normal_equations import YAW, State
from mlsm_manager.joint_solver.odometry_log import OdometryLog
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import rotated


@dataclass(frozen=True)
class OdometryErrors:
    """What the odometry was wrong by at the nodes of a run, by a fit that lets it err.

    times: (n,) s. yaws: (n,) rad as reported. headings: (n,) rad, added to these. scales: (n,) true distances over
    those that the run found, minus 1; zeros where none are reported. places: (n, 2) m, the path of that fit in map.
    """

    times: np.ndarray
    yaws: np.ndarray
    headings: np.ndarray
    scales: np.ndarray
    places: np.ndarray


def freed_errors(run: Solution) -> Optional[OdometryErrors]:
    """Return what the odometry of a run that is fitted was wrong by; None where its model cannot be freed."""
    model = run.parameters.odometry.freed
    if model is None:
        return None
    start = State(np.zeros((len(run.state.nodes), model.width)), run.state.run.copy())
    start.nodes[:, : run.state.nodes.shape[1]] = run.state.nodes
    freed = replace(run, parameters=replace(run.parameters, odometry=model), state=start)
    nodes = QuickFit.of(freed).state.nodes
    reported = run.log.node_poses(np.arange(len(nodes)))
    scales = np.zeros(len(nodes))
    if not np.isinf(model.distance_deviation):
        scales = (1.0 + nodes[:, SCALE]) / (1.0 + run.state.nodes[:, SCALE]) - 1.0
    places = reported[:, :2] + nodes[:, :2]
    return OdometryErrors(run.log.node_times.copy(), reported[:, YAW], nodes[:, YAW], scales, places)


def with_odometry(run: Solution, track: Track) -> Solution:
    """Return a run as if its odometry had reported `track`; its path is not fitted to that."""
    return replace(run, log=run.log.since(0, OdometryLog.of(track)))


def fit_from(run: Solution, starts: Sequence[State]) -> QuickFit:
    """Return the likeliest of the fits of a run that begin at each of `starts`."""
    return max((QuickFit.of(run.with_state(start)) for start in starts), key=lambda fit: fit.log_likelihood)


def path_kept(run: Solution, log: RunLog) -> State:
    """Return the path of a run as it is, by another log."""
    numbers, nodes = np.arange(len(run.state.nodes)), run.state.nodes.copy()
    nodes[:, : YAW + 1] += run.log.node_poses(numbers) - log.node_poses(numbers)
    return State(nodes, run.state.run.copy())


def path_reported(run: Solution) -> State:
    """Return the path that the odometry of a run reports: where the run is may be far off."""
    nodes = np.tile(run.parameters.odometry.first_node(), (len(run.state.nodes), 1))
    return State(nodes, run.parameters.run_mean(run.log))


def steps_kept(run: Solution, log: RunLog) -> State:
    """Return the path of a run by a log with other headings: each step as it is in the vehicle's own frame."""
    nodes = run.state.nodes.copy()
    numbers = np.arange(len(nodes))
    before, after = run.log.node_poses(numbers), log.node_poses(numbers)
    places, turns = before[:, :YAW] + nodes[:, :YAW], after[:, YAW] - before[:, YAW]
    steps = rotated(np.diff(places, axis=0), (turns[1:] + turns[:-1]) / 2.0)
    nodes[1:, :YAW] = places[0] + np.cumsum(steps, axis=0) - after[1:, :YAW]
    return State(nodes, run.state.run.copy())


def reckoned(run: Solution, log: RunLog, nodes: np.ndarray, stretch: Tuple[float, float]) -> np.ndarray:
    """Return the nodes with those of a stretch where `log` leads, and the later ones moved along."""
    result = nodes.copy()
    first, last = np.searchsorted(log.node_times, stretch)
    for node in range(max(first, 1), min(last + 1, len(nodes))):
        motion = log.node_motion(np.array([node - 1, node]))
        result[node, :YAW] = run.parameters.odometry.advanced(result[node - 1 : node], motion)[0, :YAW]
        result[node + 1 :, :YAW] = nodes[node + 1 :, :YAW] + result[node, :YAW] - nodes[node, :YAW]
    return result
