"""What the live solver knows when a scan has ended: of one scan, and of whole turns of the head."""

from dataclasses import dataclass, field
from typing import NamedTuple, Optional, Sequence

import numpy as np

from mlsm_manager.joint_solver.motion_models import DRIFT_SCALE, Drift
from mlsm_manager.joint_solver.normal_equations import POSE, POSE_COLUMNS, RUN_COLUMNS
from mlsm_manager.joint_solver.prior_mixture import PriorTerm


@dataclass(frozen=True)
class LiveEstimate:
    """Known from the scan that ended at `time` [s] and those before it.

    T_odom_base: (3,) then, x y [m], yaw [rad]. T_map_base: (3,) then. node: (width,) the newest node's unknowns.
    run: (2,) the run's unknowns. covariance: (width + 2, width + 2) of both.
    own_covariance: the same if the frozen map had no error. reported_velocity: (3,) m/s, m/s, rad/s that the odometry
    reported in base_link. drift: how the true motion differs from it.
    world_scale_deviation: of all lengths. comparisons: number of the scan's points that were compared with others.
    agreement: share of the scan's points with neighbours in other scans that lie on the surfaces of these. distance: m,
    mean distance of the scan's points from these surfaces. surfaces: (2, 2) sum of the outer products of their normals.
    prior_term: what a mixture of priors added; of no unknowns for models without one.
    misfit_variance: m^2 in each direction, how uncertain scans that fitted nowhere make the place. doubt: (3, 3) what
    another odometry that the vehicle may have adds to the covariance of the pose.
    """

    time: float
    T_odom_base: np.ndarray
    T_map_base: np.ndarray
    node: np.ndarray
    run: np.ndarray
    covariance: np.ndarray
    own_covariance: np.ndarray
    reported_velocity: np.ndarray
    drift: Drift
    world_scale_deviation: float
    comparisons: int
    agreement: float
    distance: float
    surfaces: np.ndarray
    prior_term: PriorTerm
    misfit_variance: float = 0.0
    doubt: np.ndarray = field(default_factory=lambda: np.zeros((POSE_COLUMNS, POSE_COLUMNS)))

    @property
    def pose_covariance(self) -> np.ndarray:
        """(3, 3) of T_map_base: m^2, m rad, rad^2; what the world's scale adds grows from the map's origin."""
        by_scale = scale_covariance(self.T_map_base[np.newaxis], self.world_scale_deviation)[0]
        by_misfit = misfit_covariance(np.array([self.misfit_variance]))[0]
        return self.covariance[POSE, POSE] + by_scale + by_misfit + self.doubt

    @property
    def stated_deviation(self) -> float:
        """Standard deviation of the position [m], in both directions together."""
        return float(np.sqrt(np.trace(self.pose_covariance[:2, :2])))

    @property
    def length_deviation(self) -> float:
        """Relative standard deviation of the lengths of the path: by the odometry's scale and the world's."""
        by_odometry = self.drift.slopes[DRIFT_SCALE]
        variance = by_odometry @ self.covariance[:-RUN_COLUMNS, :-RUN_COLUMNS] @ by_odometry
        return float(np.hypot(np.sqrt(variance), self.world_scale_deviation))

    @property
    def deviations(self) -> np.ndarray:
        """(width + 2,) standard deviations of `node` if the frozen map had no error, and of `run`, which these bend."""
        of_node, of_run = np.diag(self.own_covariance)[:-RUN_COLUMNS], np.diag(self.covariance)[-RUN_COLUMNS:]
        return np.sqrt(np.append(of_node, of_run))

    @property
    def velocity(self) -> np.ndarray:
        """(3,) of the vehicle in base_link, m/s, m/s, rad/s."""
        moved = self._gain * complex(*self.reported_velocity[:2])
        return np.array([moved.real, moved.imag, self.reported_velocity[2]]) + self.drift.values[:3]

    @property
    def velocity_covariance(self) -> np.ndarray:
        """(3, 3) of `velocity`: what the unknowns of the newest node leave open, without noise of what is reported."""
        reported, by_drift = complex(*self.reported_velocity[:2]), np.eye(3, len(self.drift.values))
        by_gain, by_direction = np.exp(1j * self.drift.values[4]) * reported, 1j * self._gain * reported
        by_drift[:2, 3] = by_gain.real, by_gain.imag
        by_drift[:2, 4] = by_direction.real, by_direction.imag
        slopes = by_drift @ self.drift.slopes
        return slopes @ self.covariance[:-RUN_COLUMNS, :-RUN_COLUMNS] @ slopes.T

    @property
    def _gain(self) -> complex:
        return complex((1.0 + self.drift.values[3]) * np.exp(1j * self.drift.values[4]))


def scale_covariance(poses: np.ndarray, deviation: float) -> np.ndarray:
    """Return what an error of the world's scale adds to the covariances (n, 3, 3) of poses (n, 3) in map.

    deviation: of the scale, as a share of 1.
    """
    lengths = poses * np.array([1.0, 1.0, 0.0])
    return deviation**2 * lengths[:, :, np.newaxis] * lengths[:, np.newaxis]


def misfit_covariance(variances: np.ndarray) -> np.ndarray:
    """Return what an uncertainty of the place by `variances` (n,) [m^2] adds to the covariances (n, 3, 3) of poses."""
    return variances[:, np.newaxis, np.newaxis] * np.diag([1.0, 1.0, 0.0])


def expected_deviations(moves: np.ndarray, lengths: np.ndarray, heading_deviation: float) -> np.ndarray:
    """Return by how much (n,) [m] positions are uncertain whatever the water tells: by compass and lengths.

    moves: (n, 2) m from where the run began. lengths: (n,) relative deviations. heading_deviation: rad.
    """
    return np.hypot(*moves.T) * np.hypot(heading_deviation, lengths)


class Turns(NamedTuple):
    """n turns. times: (n,) s of their ends. agreements: (n,), surfaces: (n, 2, 2), see LiveEstimate.

    apart: (n,) bool, whether their place in the map is not known.
    """

    times: np.ndarray
    agreements: np.ndarray
    surfaces: np.ndarray
    apart: np.ndarray

    @classmethod
    def of(cls, estimates: Sequence[LiveEstimate], apart: np.ndarray, parts: int) -> "Turns":
        """Return those of `estimates` and `apart`, both (n parts,), `parts` of which belong to each turn."""
        ends = estimates[parts - 1 :: parts]
        return cls(
            times=np.array([estimate.time for estimate in ends]),
            agreements=np.array([estimate.agreement for estimate in estimates]).reshape(-1, parts).mean(axis=1),
            surfaces=np.array([estimate.surfaces for estimate in estimates]).reshape(-1, parts, 2, 2).sum(axis=1),
            apart=apart[parts - 1 :: parts],
        )

    @classmethod
    def with_echoes(
        cls, estimates: Sequence[Optional[LiveEstimate]], apart: np.ndarray, parts: int, point_counts: np.ndarray,
        most: int,
    ) -> "Turns":  # fmt: skip
        """Return the newest `most` turns in which surfaces were heard; point_counts: (n parts,) of the scans.

        Turns whose estimates are forgotten are left out.
        """
        heard = np.flatnonzero(point_counts.reshape(-1, parts).any(axis=1))[-most:]
        heard = heard[[estimates[turn * parts] is not None for turn in heard]]
        scans = (heard[:, np.newaxis] * parts + np.arange(parts)).ravel()
        return cls.of([estimates[scan] for scan in scans], apart[scans], parts)
