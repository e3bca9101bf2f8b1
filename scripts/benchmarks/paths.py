"""The joint solver on a recording whose truth is known: how far its paths are off, and how honest it is about that."""

from typing import Callable, List, NamedTuple, Tuple

import numpy as np

from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.odometry_log import as_complex
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.offline.recording import Recording, scans_of
from mlsm_manager.offline.replay import ReplayParameters
from mlsm_manager.offline.suited_parameters import with_odometry
from mlsm_manager.scan_matching.scan import Scan
from sonar_processing.filters.echo_extractor import EchoExtractor

Truth = Callable[[np.ndarray], np.ndarray]
"""From times (n,) [s] to true places (n, 2 or more) [m]."""


class PathFigures(NamedTuple):
    """Of a path at the scans' ends; path and truth begin at the same place and are not turned.

    mean, most: distance from the truth [m]. shape: mean distance [m] once the path is shifted, turned and scaled to
    fit best: what is left of `mean` if compass, odometry and speed of sound were right on average. nees: squared error
    over stated variance, per state; 1 is true. stated, stated_most: median and largest stated deviation [m]. within:
    share of the scans within three of them.
    """

    mean: float
    most: float
    shape: float
    nees: float
    stated: float
    stated_most: float
    within: float

    def line(self) -> str:
        """Return them as text."""
        return (
            f"{self.mean:.2f} m in the mean, {self.most:.2f} m at most, shape {self.shape:.2f} m, NEES per state "
            f"{self.nees:.2f}; stated deviation {self.stated:.2f} m, {self.stated_most:.2f} m at most; within three of "
            f"them {100.0 * self.within:.0f} %"
        )


def replay_input(recording: Recording, kind: OdometryKind) -> Tuple[List[Scan], ReplayParameters]:
    """Return the scans and parameters that map_bag uses for an odometry."""
    parameters = with_odometry(ReplayParameters(), kind, ())
    return [scan for scan, _ in scans_of(recording, EchoExtractor(parameters.echoes()))], parameters


def solved_live(recording: Recording, kind: OdometryKind) -> LiveSolver:
    """Return the joint solver after all scans of a recording."""
    scans, parameters = replay_input(recording, kind)
    solver = LiveSolver(parameters.solver_parameters(), RunLog(recording.sonar_in_base))
    for scan in scans:
        solver.add(scan)
    return solver


def live_figures(solver: LiveSolver, truth: Truth, is_judged: Truth = lambda times: times > 0.0) -> PathFigures:
    """Return those of the live path; is_judged: from times (n,) to which scans (n,) count."""
    path = np.array([estimate.T_map_base[:2] for estimate in solver.estimates])
    covariances = np.array([estimate.pose_covariance[:2, :2] for estimate in solver.estimates])
    chosen = is_judged(solver.log.node_times[1:])
    return judged(path[chosen], _aligned(solver, truth)[chosen], covariances[chosen])


def _aligned(solver: LiveSolver, truth: Truth) -> np.ndarray:
    """Return the true places (n, 2) at the scans' ends, shifted to begin where the path does."""
    places = truth(solver.log.node_times)[:, :2]
    return places[1:] - places[0] + solver.log.node_poses(np.array([0]))[0, :2]


def judged(path: np.ndarray, truth: np.ndarray, covariances: np.ndarray) -> PathFigures:
    """Return the figures of a path (n, 2) with its stated covariances (n, 2, 2); truth: (n, 2), aligned."""
    error = path - truth
    squared = np.einsum("na,na->n", error, np.linalg.solve(covariances, error[..., np.newaxis])[..., 0])
    distance, stated = np.hypot(*error.T), np.sqrt(np.trace(covariances, axis1=1, axis2=2))
    return PathFigures(
        distance.mean(), distance.max(), shape_error(path, truth), squared.mean() / 2.0, np.median(stated),
        stated.max(), np.mean(distance < 3.0 * stated),
    )  # fmt: skip


def shape_error(path: np.ndarray, truth: np.ndarray) -> float:
    """Return the mean distance [m] of a path (n, 2) from the truth, shifted, turned and scaled to fit best."""
    own, true = (as_complex(places - places.mean(axis=0)) for places in (path, truth))
    return float(np.abs(true - np.vdot(own, true) / np.vdot(own, own) * own).mean())
