"""Points of clouds where the unknowns say that they lie: for the map, whatever was not used to find the unknowns."""

import numpy as np

from mlsm_manager.multi_view.run_log import RunLog
from mlsm_manager.multi_view.state import DELAY, POSE_COLUMNS, RANGE_SCALE, State
from node_support.geometry.planar import inverse, transformed


def drawn(log: RunLog, state: State, points: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return points (n, >= 2) in map of points (n, >= 2) that the odometry placed in odom at `times` (n,) [s].

    Ranges and stamps are corrected as the run's unknowns say. Before the first node and after the last one their
    corrections hold.
    """
    seen = transformed(inverse(log.odometry.at(times)), points)
    sonar = log.sonar_in_base
    seen[:, :2] = sonar + (1.0 + state.run[RANGE_SCALE]) * (seen[:, :2] - sonar)
    return transformed(corrected_path(log, state, times + state.run[DELAY]), seen)


def corrected_path(log: RunLog, state: State, times: np.ndarray) -> np.ndarray:
    """Return T_map_base (m, 3) at `times` (m,): the odometry's poses plus the nodes' corrections, linear in between."""
    nodes = [np.interp(times, log.node_times, state.nodes[:, column]) for column in range(POSE_COLUMNS)]
    return log.odometry.at(times) + np.stack(nodes, axis=-1)
