"""The matchers that figures compare, with default parameters: ours, the thesis's, and Open3D's generalised ICP."""

import time
from importlib import import_module
from typing import Any, Callable, Dict

import numpy as np

from mlsm_manager.localisation.parameters import MapParameters
from mlsm_manager.scan_matching.distribution_matcher import NEARBY, DistributionMatcher
from mlsm_manager.scan_matching.distributions import LocalDistributions
from mlsm_manager.scan_matching.scan import Belief, Matcher, MatchResult, MatchStatus, Scan
from mlsm_manager.scan_matching.scan_path import ERRORS, POSE, RATE
from mlsm_manager.surface_map.blocks import BlockSource, all_of
from mlsm_manager.thesis_matching.thesis_matcher import ThesisMatcher, ThesisMatcherParameters
from node_support.geometry import composed, move_of, seen_from, transformed, wrapped

_FEWEST, _REACH, _MOST_ITERATIONS = 15, 2.0, 50  # points; m; steps, which end one that swings between two poses
_MOST_DEVIATION, _MOST_JUMP = 0.5, 4.0  # m; standard deviations: as the other matchers reject
_ECHO_VARIANCE = 0.1**2  # m^2, as the range resolution of 50 m in 500 bins; keeps points in their plane too
_PLANAR = np.array([3, 4, 2])  # Of Open3D's [rotation, translation]: x, y and yaw
_LEAST_ERROR = 1e-3  # m, of an echo that meets its block exactly, so that the covariance can be inverted


BEAM_WIDTH = MapParameters().beam_width
"""rad, of the simulated head."""


class GicpMatcher:
    """Generalised ICP (Segal et al. 2009) of echoes with the local distributions of the map.

    It starts from the prior's pose and finds a rigid planar pose only: it neither searches nor estimates velocity.
    """

    def __init__(self) -> None:
        """Raises ImportError without Open3D."""
        self._open3d = import_module("open3d")

    def match(self, scan: Scan, target: BlockSource, belief: Belief) -> MatchResult:
        """Return where the scan was taken; see Matcher."""
        blocks, expected = all_of(target), belief.theta[POSE]
        status, pose, covariance = MatchStatus.TOO_FEW_POINTS, expected, belief.covariance[POSE, POSE]
        start, used, error = time.perf_counter(), 0, np.inf
        if min(len(scan), len(blocks)) >= _FEWEST:
            # About the vehicle: turns and moves are independent there, and a map may lie far from its origin.
            origin = np.append(expected[:2], 0.0)
            correction = move_of(scan.reference_pose, expected)
            points = transformed(seen_from(origin, correction), scan.points)[:, :2]
            shapes = LocalDistributions(blocks)
            found, information = self._register(points, shapes.mean - origin[:2], shapes.covariance)
            used, error = len(found.correspondence_set), float(found.inlier_rmse)
        if used >= _FEWEST:
            matrix = found.transformation
            moved = np.array([matrix[0, 3], matrix[1, 3], np.arctan2(matrix[1, 0], matrix[0, 0])])
            pose = composed(move_of(origin, composed(origin, moved)), expected)
            covariance = np.linalg.inv(information) * max(error, _LEAST_ERROR) ** 2
            status = _judged(pose - expected, covariance, belief)
        numbers = {"points_used": used, "error": error, "seconds": time.perf_counter() - start}
        return _result(scan, belief, status, pose, covariance, numbers)

    def _register(self, points: np.ndarray, means: np.ndarray, covariances: np.ndarray) -> tuple:
        """Return Open3D's result and the (3, 3) information of x, y, yaw for echoes that err by 1 m."""
        registration = self._open3d.pipelines.registration
        source = self._cloud(points, np.tile(np.eye(2) * _ECHO_VARIANCE, (len(points), 1, 1)))
        target = self._cloud(means, covariances)
        limit = registration.ICPConvergenceCriteria(max_iteration=_MOST_ITERATIONS)
        estimation = registration.TransformationEstimationForGeneralizedICP()
        found = registration.registration_generalized_icp(source, target, _REACH, np.eye(4), estimation, limit)
        full = registration.get_information_matrix_from_point_clouds(source, target, _REACH, found.transformation)
        return found, np.asarray(full)[np.ix_(_PLANAR, _PLANAR)]

    def _cloud(self, points: np.ndarray, covariances: np.ndarray) -> Any:
        """Return Open3D's cloud of points (n, 2) with covariances (n, 2, 2), in the plane z = 0."""
        utility, spatial = self._open3d.utility, np.zeros((len(points), 3, 3))
        spatial[:, :2, :2] = covariances
        spatial[:, 2, 2] = _ECHO_VARIANCE
        level = np.column_stack([points, np.zeros(len(points))])
        cloud = self._open3d.geometry.PointCloud(utility.Vector3dVector(level))
        cloud.covariances = utility.Matrix3dVector(spatial)
        return cloud


def _judged(difference: np.ndarray, covariance: np.ndarray, belief: Belief) -> MatchStatus:
    difference = np.append(difference[:2], wrapped(difference[2]))
    jump = np.sqrt(difference @ np.linalg.solve(belief.covariance[POSE, POSE] + covariance, difference))
    if jump > _MOST_JUMP:
        return MatchStatus.REJECTED_JUMP
    deviation = np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1])
    return MatchStatus.AMBIGUOUS if deviation > _MOST_DEVIATION else MatchStatus.CONVERGED


def _result(
    scan: Scan, belief: Belief, status: MatchStatus, pose: np.ndarray, covariance: np.ndarray, numbers: dict
) -> MatchResult:
    """Return the result; besides the pose what was believed stays."""
    theta, state = np.append(pose, belief.theta[ERRORS]), belief.covariance.copy()
    theta[2] = wrapped(theta[2])
    if status is MatchStatus.CONVERGED:
        state[POSE, :] = state[:, POSE] = 0.0
        state[POSE, POSE] = covariance
    beam_times = np.unique(np.append(scan.times, scan.reference_time))
    return MatchResult(
        status=status, belief=Belief(scan.reference_time, theta, state),
        velocity=scan.track.velocity_at(scan.reference_time) + theta[RATE], covariance=state[:6, :6],
        beam_times=beam_times, beam_poses=composed(move_of(scan.reference_pose, pose), scan.track.at(beam_times)),
        reason="", **numbers,
    )  # fmt: skip


DISTRIBUTIONS = "DISTRIBUTIONS"
MATCHERS: Dict[str, Callable[[], Matcher]] = {
    DISTRIBUTIONS: lambda: DistributionMatcher(NEARBY, BEAM_WIDTH, 0.0),
    "THESIS": lambda: ThesisMatcher(ThesisMatcherParameters()),
    "GICP": GicpMatcher,
}
"""What makes each of them, by their names in tables."""
