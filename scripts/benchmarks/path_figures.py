"""How far a solver's paths are from a known truth, and how honest it is about that."""

from typing import NamedTuple, Tuple

import numpy as np

from mlsm_manager.joint_solver.motion.odometry_motion import as_complex
from mlsm_manager.joint_solver.solve.batch_solver import BatchResult
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver


class PathFigures(NamedTuple):
    """Of a path at the scans' ends; path and truth begin at the same place and are not turned.

    mean, most: distance from the truth [m]. shape: mean distance [m] once the path is shifted, turned and scaled to
    fit best: what is left of `mean` if compass, odometry and speed of sound were right on average. nees: squared error
    over told variance, per state; 1 is true. told: median told deviation [m].
    """

    mean: float
    most: float
    shape: float
    nees: float
    told: float

    def line(self) -> str:
        """Return them as text."""
        return (
            f"{self.mean:.2f} m in the mean, {self.most:.2f} m at most, shape {self.shape:.2f} m, NEES per state "
            f"{self.nees:.2f}, told {self.told:.2f} m"
        )


def figures_of(solver: LiveSolver, batch: BatchResult, truth: np.ndarray) -> Tuple[PathFigures, PathFigures]:
    """Return those of the live path and of the fit of the whole run; truth: (n + 1, 2) m at the nodes of n scans."""
    nodes = solver.log.node_poses(np.arange(len(truth)))
    true = truth[1:] - truth[0] + nodes[0, :2]
    live = np.array([estimate.T_map_base for estimate in solver.estimates])
    fitted = nodes[1:] + batch.state.nodes[1:, :3]
    told = np.array([estimate.pose_covariance for estimate in solver.estimates]), batch.pose_covariances[1:]
    return tuple(_judged(path[:, :2], true, own[:, :2, :2]) for path, own in zip((live, fitted), told))


def _judged(path: np.ndarray, truth: np.ndarray, covariances: np.ndarray) -> PathFigures:
    error = path - truth
    squared = np.einsum("na,na->n", error, np.linalg.solve(covariances, error[..., np.newaxis])[..., 0])
    distance, deviation = np.hypot(*error.T), np.sqrt(np.trace(covariances, axis1=1, axis2=2))
    return PathFigures(
        float(distance.mean()), float(distance.max()), shape_error(path, truth), float(squared.mean() / 2.0),
        float(np.median(deviation)),
    )  # fmt: skip


def shape_error(path: np.ndarray, truth: np.ndarray) -> float:
    """Return the mean distance [m] of a path (n, 2) from the truth, shifted, turned and scaled to fit best."""
    own, true = (as_complex(places - places.mean(axis=0)) for places in (path, truth))
    return float(np.abs(true - np.vdot(own, true) / np.vdot(own, own) * own).mean())
