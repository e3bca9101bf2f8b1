"""Older scans that no longer move: the nearest blocks of them, what they say and how certain they are."""

from dataclasses import dataclass

import numpy as np

from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.motion.motion_models import OdometryModel
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placing.placement import PlacedPoints, place
from mlsm_manager.joint_solver.unknowns.state import POSE_COLUMNS, State

_AGE_DISTANCE = 5.0  # m by which the newest block counts as farther than the oldest: the oldest drifted least
_FADING = 0.1  # share of the reach within which a block fades out, so that no block appears at once
_NO_DISTANCE = 1e-9  # m: keeps blocks at one place from dividing by zero


@dataclass(frozen=True)
class FrozenMap:
    """Points of frozen blocks, placed with the run's unknowns at `run` (2,).

    importance: (n,) factor of each point's weight, 0 at the border of what is near.
    numbers: (b,) the blocks that are near, in the order of time. block_importance: (b,) the factor of each.
    """

    points: PlacedPoints
    importance: np.ndarray
    numbers: np.ndarray
    block_importance: np.ndarray
    run: np.ndarray

    def moved_by_run(self, run: np.ndarray) -> PlacedPoints:
        """Return the points with the run's unknowns at `run` (2,), to first order."""
        return self.points.moved_by_run(run - self.run)


def nearest_blocks(
    log: RunLog,
    odometry: OdometryModel,
    state: State,
    count: int,
    place_now: np.ndarray,
    parameters: SolverParameters,
) -> FrozenMap:
    """Return the blocks nearest to `place_now` (2,) among the first `count` blocks of the run."""
    scans = parameters.group_scans
    middles = np.arange(count) * scans + scans // 2
    places = log.node_poses(middles)[:, :2] + state.nodes[middles, :2]
    distances = np.hypot(*(places - place_now).T) + _AGE_DISTANCE * np.arange(count) / max(count, 1)
    importance = fading(distances, parameters.frozen_groups)
    numbers = np.flatnonzero(importance > 0.0)
    rows = np.concatenate(
        [np.empty(0, dtype=np.int64), *(log.rows(number * scans, (number + 1) * scans) for number in numbers)]
    )
    points = place(log, odometry, state, rows)
    per_point = importance[points.scans // scans] if len(rows) else np.empty(0)
    return FrozenMap(points, per_point, numbers, importance[numbers], state.run.copy())


def fading(distances: np.ndarray, most: int) -> np.ndarray:
    """Return factors (b,) of blocks at `distances` (b,) [m]: 1 for near ones, falling to 0; at most `most` are above 0.

    They depend on the distances continuously. Blocks at one distance fade together.
    """
    if len(distances) <= most:
        return np.ones(len(distances))
    border = np.partition(distances, most)[most]
    return np.clip((border - distances) / max(_FADING * border, _NO_DISTANCE), 0.0, 1.0)


def joint_covariance(covariances: np.ndarray) -> np.ndarray:
    """Return (3 b, 3 b) of the poses of b frozen places with `covariances` (b, 3, 3).

    They are taken to be correlated as the places of a random walk are: by the ratio of their deviations.
    """
    deviations = np.sqrt(covariances[:, 0, 0] + covariances[:, 1, 1])
    ratio = np.minimum.outer(deviations, deviations) / np.maximum.outer(deviations, deviations)
    factors = np.linalg.cholesky(covariances)
    joint = np.einsum("iac,jbc,ij->iajb", factors, factors, ratio)
    return joint.reshape(POSE_COLUMNS * len(covariances), POSE_COLUMNS * len(covariances))
