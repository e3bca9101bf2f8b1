"""What a compass that errs by the heading may do to a path: the part of it that echoes do not tell."""

from typing import Callable

import numpy as np

from mlsm_manager.joint_solver.motion_models import Compass
from mlsm_manager.joint_solver.normal_equations import YAW, Layout
from node_support.geometry import harmonics

# Of the cosine and sine of the heading (iron that is magnetic itself) and of twice the heading (soft iron): times the
# heading's deviation at any time, usually one degree. That is left where a compass was calibrated on its vehicle.
_TIMES = np.array([2.0, 2.0, 1.0, 1.0])


def by_heading(
    compass: Compass, layout: Layout, yaws: np.ndarray, durations: np.ndarray, solve: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Return columns (size, 4) whose outer product is what the error adds to the covariance of all unknowns.

    yaws: (n,) rad, reported at the nodes of `layout`, with (n - 1,) s between them. solve: the information's inverse
    times columns. The error is an unknown of its own that is eliminated; the solution stays where it is.
    """
    errors, change = harmonics(yaws) * _TIMES * compass.heading_deviation, compass.change(durations)
    steps = errors[1:] - change.kept[:, np.newaxis] * errors[:-1]
    weighted = steps / change.variance[:, np.newaxis]
    first = errors[0] / compass.heading_deviation**2
    nodes = layout.node_start(np.arange(layout.first, layout.last + 1)) + YAW
    shared = np.zeros((layout.size, len(_TIMES)))
    shared[nodes[1:]] += weighted
    shared[nodes[:-1]] -= change.kept[:, np.newaxis] * weighted
    shared[nodes[0]] += first
    moved = solve(shared)
    left = np.eye(len(_TIMES)) + steps.T @ weighted + np.outer(errors[0], first) - shared.T @ moved
    return np.linalg.solve(np.linalg.cholesky(left), moved.T).T
