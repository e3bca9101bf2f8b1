"""Generalised ICP of Open3D, to compare with: one rigid planar correction per scan (Segal et al. 2009).

It starts from the prior's pose and finds a pose only: it neither searches nor estimates velocity or errors of odometry.
"""

import importlib
import time
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mlsm_manager.scan_matching.distributions import LocalDistributions
from mlsm_manager.scan_matching.result import MatchResult, MatchStatus, Prior
from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.scan_matching.scan_path import POSE
from mlsm_manager.surface_map.blocks import Blocks, BlockSource, all_of
from node_support.geometry import composed, inverse, transformed, wrapped
from node_support.parameters import ParameterError, ParameterSet, parameter

# m^2: of an echo, as the range resolution of 50 m in 500 bins; across the plane of all points it keeps them there.
_ECHO_VARIANCE = 0.1**2
# More than it needs from within its reach; ends one that swings between two poses.
_MOST_ITERATIONS = 50
# Rotation about z, x and y among Open3D's six degrees of freedom [rotation, translation], as x, y and yaw of a pose.
_PLANAR = np.array([3, 4, 2])
# m: the deviation of an echo that meets its block exactly, so that the covariance can be inverted.
_LEAST_ERROR = 1e-3


class _Found(NamedTuple):
    """correction: (3,) T_map_odom. covariance: (3, 3) of the pose. error: m, root mean square. used: echoes."""

    correction: np.ndarray
    covariance: np.ndarray
    error: float
    used: int


@dataclass(frozen=True)
class GicpMatcherParameters(ParameterSet):
    """Parameters of Open3D's generalised ICP."""

    min_points: int = parameter(15, "a scan with fewer points on the map is not matched", low=3, high=10000)
    max_position_deviation: float = parameter(
        0.5, "a fix with a greater standard deviation in its least certain direction is rejected",
        unit="m", low=0.001, high=100.0,
    )  # fmt: skip
    max_jump: float = parameter(
        4.0, "greatest distance of a fix from the expected pose, in the prior's standard deviations",
        low=1.0, high=100.0,
    )  # fmt: skip
    gicp_distance: float = parameter(2.0, "greatest distance from an echo to its block", unit="m", low=0.01, high=100.0)


class GicpMatcher:
    """Matches echoes with the local distributions of the map."""

    def __init__(self, parameters: GicpMatcherParameters) -> None:
        """Raise ParameterError without Open3D."""
        self.parameters = parameters
        try:
            self._open3d = importlib.import_module("open3d")
        except ImportError:
            raise ParameterError("GICP needs Open3D; install it with: apt install python3-open3d") from None

    def match(self, scan: Scan, target: BlockSource, prior: Prior) -> MatchResult:
        """Return where the scan was taken; see Matcher."""
        start = time.perf_counter()
        target = all_of(target)
        fewest = self.parameters.min_points
        if len(scan) < fewest or len(target) < fewest:
            reason = f"{len(scan)} points and {len(target)} blocks, must be {fewest} or more"
            return _unmatched(MatchStatus.TOO_FEW_POINTS, reason, scan, prior, start)
        expected = prior.pose(scan)
        # About the vehicle: turns and moves are independent there, and a map may lie far from its origin.
        origin = np.append(expected[:2], 0.0)
        points = transformed(composed(inverse(origin), prior.correction), scan.points)[:, :2]
        found, information = self._register(points, target, origin)
        used = len(found.correspondence_set)
        if used < fewest:
            reason = f"{used} points on the map, must be {fewest} or more"
            return _unmatched(MatchStatus.TOO_FEW_POINTS, reason, scan, prior, start)
        moved = _planar(found.transformation)
        covariance = np.linalg.inv(information) * max(found.inlier_rmse, _LEAST_ERROR) ** 2
        T_map_expected = composed(composed(origin, moved), inverse(origin))
        status, reason = self._judge(composed(T_map_expected, expected), expected, covariance, prior)
        correction = composed(T_map_expected, prior.correction)
        return _result(status, reason, scan, prior, _Found(correction, covariance, found.inlier_rmse, used), start)

    def _register(self, points: np.ndarray, target: Blocks, origin: np.ndarray) -> tuple:
        """Return Open3D's result and the (3, 3) information of x, y, yaw for echoes that err by 1 m."""
        registration = self._open3d.pipelines.registration
        shapes = LocalDistributions(target)
        source = self._cloud(points, np.tile(np.eye(2) * _ECHO_VARIANCE, (len(points), 1, 1)))
        blocks = self._cloud(shapes.mean - origin[:2], shapes.covariance)
        reach = self.parameters.gicp_distance
        found = registration.registration_generalized_icp(
            source, blocks, reach, np.eye(4), registration.TransformationEstimationForGeneralizedICP(),
            registration.ICPConvergenceCriteria(max_iteration=_MOST_ITERATIONS),
        )  # fmt: skip
        full = registration.get_information_matrix_from_point_clouds(source, blocks, reach, found.transformation)
        return found, np.asarray(full)[np.ix_(_PLANAR, _PLANAR)]

    def _cloud(self, points: np.ndarray, covariance: np.ndarray) -> Any:
        """Return Open3D's cloud of points (n, 2) with covariances (n, 2, 2), in the plane z = 0."""
        utility = self._open3d.utility
        spatial = np.zeros((len(points), 3, 3))
        spatial[:, :2, :2] = covariance
        spatial[:, 2, 2] = _ECHO_VARIANCE
        cloud = self._open3d.geometry.PointCloud(
            utility.Vector3dVector(np.column_stack([points, np.zeros(len(points))]))
        )
        cloud.covariances = utility.Matrix3dVector(spatial)
        return cloud

    def _judge(self, pose: np.ndarray, expected: np.ndarray, covariance: np.ndarray, prior: Prior) -> tuple:
        difference = pose - expected
        difference[2] = wrapped(difference[2])
        allowed = prior.covariance[POSE, POSE] + covariance
        jump = float(np.sqrt(difference @ np.linalg.solve(allowed, difference)))
        if jump > self.parameters.max_jump:
            return MatchStatus.REJECTED_JUMP, f"{jump:.1f} standard deviations from where it was expected"
        deviation = float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
        if deviation > self.parameters.max_position_deviation:
            return MatchStatus.AMBIGUOUS, f"standard deviation of {deviation:.2f} m in the least certain direction"
        return MatchStatus.CONVERGED, ""


def _planar(transformation: np.ndarray) -> np.ndarray:
    """Return (3,) x, y, yaw of a (4, 4) transformation within the plane."""
    return np.array(
        [transformation[0, 3], transformation[1, 3], np.arctan2(transformation[1, 0], transformation[0, 0])]
    )


def _unmatched(status: MatchStatus, reason: str, scan: Scan, prior: Prior, start: float) -> MatchResult:
    return _result(
        status, reason, scan, prior, _Found(prior.correction, prior.covariance[POSE, POSE], np.inf, 0), start
    )


def _result(status: MatchStatus, reason: str, scan: Scan, prior: Prior, found: _Found, start: float) -> MatchResult:
    """Return the result of a match that began at `start` [s]; besides the pose the state stays the prior's.

    Open3D does not tell the number of its iterations: 0.
    """
    beam_times = np.unique(np.append(scan.times, scan.reference_time))
    pose = composed(found.correction, scan.reference_pose)
    pose[2] = wrapped(pose[2])
    state = prior.covariance.copy()
    if status is MatchStatus.CONVERGED:
        state[POSE, :] = state[:, POSE] = 0.0
        state[POSE, POSE] = found.covariance
    return MatchResult(
        status=status, pose=pose, velocity=scan.track.velocity_at(scan.reference_time) + prior.rate,
        covariance=state[:6, :6], rate=prior.rate, motion=prior.motion, state_covariance=state,
        error=float(found.error), points_used=found.used, iterations=0, seconds=time.perf_counter() - start,
        beam_times=beam_times, beam_poses=composed(found.correction, scan.track.at(beam_times)), reason=reason,
    )  # fmt: skip
