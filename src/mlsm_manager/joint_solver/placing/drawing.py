"""Points of clouds where the unknowns say that they lie: for the map, whatever was not used to find the unknowns."""

import numpy as np

from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.motion.motion_models import OdometryModel
from mlsm_manager.joint_solver.placing.path import NodePath
from mlsm_manager.joint_solver.unknowns.state import DELAY, RANGE_SCALE, State
from node_support.geometry import inverse, transformed


def drawn(log: RunLog, odometry: OdometryModel, state: State, points: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return points (n, >= 2) in map of points (n, >= 2) that the odometry placed in odom at `times` (n,) [s].

    Ranges and stamps are corrected as the run's unknowns say. Before the first node and after the last one the
    motion goes on.
    """
    seen = transformed(inverse(log.odometry.at(times)), points)
    sonar = log.sonar_in_base
    seen[:, :2] = sonar + (1.0 + state.run[RANGE_SCALE]) * (seen[:, :2] - sonar)
    return transformed(corrected_path(log, odometry, state, times + state.run[DELAY]), seen)


def corrected_path(log: RunLog, odometry: OdometryModel, state: State, times: np.ndarray) -> np.ndarray:
    """Return T_map_base (m, 3) at `times` (m,) [s]."""
    if not len(times):
        return np.empty((0, 3))
    first, last = np.searchsorted(log.node_times, [times.min(), times.max()])
    near = slice(max(min(first, len(log.node_times) - 1) - 1, 0), last + 1)
    return NodePath(odometry, log.odometry, log.node_times[near], state.nodes[near]).at(times)
