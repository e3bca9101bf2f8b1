"""Terms that several odometry models share: random walks and processes that forget."""

import numpy as np

from mlsm_manager.joint_solver.motion.odometry_parameters import Compass
from mlsm_manager.joint_solver.unknowns.normal_equations import NormalEquations
from mlsm_manager.joint_solver.unknowns.state import YAW

_CONSTANT_DEVIATION = 1e-6  # of what hardly changes from node to node, far below any effect


def add_walk(
    equations: NormalEquations, starts: np.ndarray, width: int, values: np.ndarray, column: int, variance: np.ndarray
) -> None:
    """Add that unknown `column` of nodes changes by nothing but for `variance` (n - 1,) from node to node.

    starts: (n - 1,) columns of all nodes but the last. values: (n,) of the unknown.
    """
    add_forgetting(equations, starts, width, values, column, np.ones(len(starts)), variance)


def add_forgetting(
    equations: NormalEquations, starts: np.ndarray, width: int, values: np.ndarray, column: int, kept: np.ndarray,
    variance: np.ndarray,
) -> None:  # fmt: skip
    """Add that of an unknown the share `kept` (n - 1,) is left at the next node, but for `variance` (n - 1,)."""
    columns = np.column_stack([starts + width + column, starts + column])
    jacobian = np.column_stack([np.ones(len(starts)), -kept])
    weight = 1.0 / np.maximum(variance, _CONSTANT_DEVIATION**2)
    equations.add(columns, jacobian, values[1:] - kept * values[:-1], weight)


def add_compass(
    equations: NormalEquations, starts: np.ndarray, nodes: np.ndarray, durations: np.ndarray, compass: Compass
) -> None:
    """Add how the correction of the reported heading changes: an error that lasts, and a walk.

    starts: (n - 1,) columns of all nodes but the last. nodes: (n, width). durations: (n - 1,) s between them.
    """
    kept = np.exp(-durations / compass.heading_time)
    variance = compass.heading_deviation**2 * (1.0 - kept**2) + compass.heading_walk**2 * durations
    add_forgetting(equations, starts, nodes.shape[1], nodes[:, YAW], YAW, kept, variance)


def turned(angle: np.ndarray) -> np.ndarray:
    """Return the complex numbers that turn by `angle` (...) [rad]."""
    return np.exp(1j * angle)
