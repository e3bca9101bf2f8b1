"""What the joint solver's estimates mean for the localiser: belief, correction, match and update."""

from typing import Optional

import numpy as np

from mlsm_manager.joint_solver.placing.estimate import LiveEstimate
from mlsm_manager.joint_solver.unknowns.state import POSE_COLUMNS, RUN_COLUMNS
from mlsm_manager.localisation.joint_session import JointSession
from mlsm_manager.localisation.updates import ScanUpdate
from mlsm_manager.scan_matching.prediction import Belief, Fading, OdometryErrors, prior_of
from mlsm_manager.scan_matching.result import MatchResult, MatchStatus, Prior
from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.scan_matching.scan_path import ERRORS, MOTION, POSE, RATE, STATES
from node_support.geometry import composed, inverse, wrapped

PATH_POINTS = 17
"""Points of the path within a scan: about one per second of a slow head's revolution."""


def belief_of(estimate: LiveEstimate, errors: OdometryErrors, fading: Optional[Fading]) -> Belief:
    """Return pose and odometry errors; of errors that the solver does not estimate, what is known beforehand.

    fading: of the rates after the estimate.
    """
    drift = estimate.drift
    slopes = np.zeros((STATES, estimate.node.size))
    slopes[:POSE_COLUMNS, :POSE_COLUMNS] = np.eye(POSE_COLUMNS)
    slopes[ERRORS] = drift.slopes
    of_node = estimate.covariance[:-RUN_COLUMNS, :-RUN_COLUMNS]
    covariance = slopes @ of_node @ slopes.T
    unknown = ~slopes.any(axis=1)
    covariance[unknown, unknown] = np.diag(errors.covariance())[unknown]
    return Belief(estimate.time, np.append(estimate.T_map_base, drift.values), covariance, fading)


def belief_at(time: float, pose: np.ndarray, errors: OdometryErrors) -> Belief:
    """Return a belief in a pose (3,) that is taken as certain, with odometry errors as they are beforehand."""
    return Belief(time, np.concatenate([pose, np.zeros(STATES - POSE_COLUMNS)]), errors.covariance())


def belief_of_match(scan: Scan, result: MatchResult, errors: OdometryErrors) -> Belief:
    """Return a belief in the pose that a match found, with odometry errors as they are beforehand."""
    belief = belief_at(scan.reference_time, result.pose, errors)
    belief.covariance[POSE, POSE] = result.covariance[POSE, POSE]
    return belief


def prior_at(correction: np.ndarray, scan: Scan, expected: Belief) -> Prior:
    """Return a prior where `correction` T_map_odom (3,) puts the end of a scan, as sure as `expected`."""
    theta = np.concatenate([composed(correction, scan.reference_pose), expected.theta[POSE_COLUMNS:]])
    return prior_of(Belief(scan.reference_time, theta, expected.covariance), scan.reference_pose)


def correction_of(T_map_base: np.ndarray, scan: Scan) -> np.ndarray:
    """Return T_map_odom (3,) that puts the end of a scan to T_map_base (3,)."""
    correction = composed(T_map_base, inverse(scan.reference_pose))
    correction[2] = wrapped(correction[2])
    return correction


def path_times(start: float, end: float) -> np.ndarray:
    """Return the times (PATH_POINTS,) s at which the path within a scan is told."""
    return np.linspace(start, end, PATH_POINTS)


def update_of(scan: Scan, session: JointSession, belief: Belief, seconds: float) -> ScanUpdate:
    """Return what a run that has just taken a scan made of it. seconds: that it took."""
    solver = session.solver
    estimate = solver.estimates[-1]
    if not estimate.comparisons:
        return ScanUpdate(scan, None, True, belief, provisional=session.is_provisional)
    result = _match(scan, estimate, belief, session, seconds)
    return ScanUpdate(scan, result, True, belief, solver.found, session.is_provisional)


def _match(scan: Scan, estimate: LiveEstimate, belief: Belief, session: JointSession, seconds: float) -> MatchResult:
    """Return what the solver found for a scan, as a matcher would say it."""
    times = path_times(min(scan.start, estimate.time - 1e-3), estimate.time)
    return MatchResult(
        status=MatchStatus.CONVERGED, pose=estimate.T_map_base, velocity=estimate.velocity,
        covariance=_fix_covariance(estimate), rate=belief.theta[RATE], motion=belief.theta[MOTION],
        state_covariance=belief.covariance, error=estimate.distance, points_used=estimate.comparisons,
        iterations=session.solver.parameters.live_iterations, seconds=seconds, beam_times=times,
        beam_poses=session.path(times),
    )  # fmt: skip


def _fix_covariance(estimate: LiveEstimate) -> np.ndarray:
    """Return the covariance (6, 6) of pose and velocity; what both share is left out."""
    covariance = np.zeros((6, 6))
    covariance[:3, :3], covariance[3:, 3:] = estimate.pose_covariance, estimate.velocity_covariance
    return covariance
