"""Matches keyframes with each other: each with some before it, and with earlier ones of the same place.

What a keyframe is matched with is an earlier one and its two neighbours: a single scan has gaps, and many together hide
how they lie to each other.
"""

from dataclasses import dataclass
from typing import Callable, List, Optional, Tuple

import numpy as np

from mlsm_manager.matching.matchers.matcher_table import Matcher
from mlsm_manager.matching.problem.prediction import OdometryErrors
from mlsm_manager.matching.problem.result import MatchResult, Prior
from mlsm_manager.matching.problem.state import MOTION, POSE
from mlsm_manager.offline.keyframes import Keyframe
from mlsm_manager.offline.pose_graph import RelativePoses
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry.planar import composed, inverse, rotated, transformed, wrapped

_LAGS = (2, 5, 9, 14)
_BESIDE = 1
_LOOP_AGE = 15
_LOOPS = 2
_LOOPS_APART = 3
_REACH = 30.0
_LEAST_INFORMATION = 1e-9
_PLACE_DEVIATION = 1.0
_HEADING_DEVIATION = 0.0175

_Edge = Tuple[int, int, np.ndarray, np.ndarray]
"""First and second keyframe, T_first_second (3,), and its information (3, 3)."""


@dataclass(frozen=True)
class ScanMatching:
    """How keyframes are matched. resolution: of the target, m. motion: (2,) lasting errors of the odometry."""

    matcher: Matcher
    errors: OdometryErrors
    resolution: float
    motion: np.ndarray


def scan_edges(
    keyframes: List[Keyframe], poses: np.ndarray, matching: ScanMatching, on_match: Callable[[int], None]
) -> RelativePoses:
    """Return the edges that matching finds; `on_match` is called with 1 for every keyframe that is done."""
    found: List[_Edge] = []
    for index in range(1, len(keyframes)):
        for other in partners(poses, index):
            edge = _edge(keyframes, poses, other, index, matching)
            if edge is not None:
                found.append(edge)
        on_match(1)
    return _joined(found)


def partners(poses: np.ndarray, index: int) -> List[int]:
    """Return the earlier keyframes around which keyframe `index` is matched: some before it, and of its place.

    poses: (k, 3). The first of them always is; the others only within 30 m.
    """
    if index == 0:
        return []
    distance = np.hypot(*(poses[:index, :2] - poses[index, :2]).T)
    before = [index - lag for lag in _LAGS[1:] if lag <= index and distance[index - lag] < _REACH]
    return [max(index - _LAGS[0], 0), *before, *_revisited(distance[: max(index - _LOOP_AGE, 0)])]


def _revisited(distance: np.ndarray) -> List[int]:
    found: List[int] = []
    for other in np.argsort(distance):
        if distance[other] > _REACH or len(found) == _LOOPS:
            break
        if all(abs(int(other) - known) > _LOOPS_APART for known in found):
            found.append(int(other))
    return found


def _edge(
    keyframes: List[Keyframe], poses: np.ndarray, first: int, second: int, matching: ScanMatching
) -> Optional[_Edge]:
    surfaces = MultiLevelSurfaceMap(matching.resolution)
    for one in range(max(first - _BESIDE, 0), min(first + _BESIDE + 1, second)):
        surfaces.insert(transformed(poses[one], keyframes[one].seen))
    prior = _prior(keyframes[second], poses[second], matching)
    result = matching.matcher.match(keyframes[second].scan, surfaces.blocks, prior)
    if not result.accepted:
        return None
    pose, information = measured_alone(result, poses[second], prior.covariance[POSE, POSE])
    turn = np.eye(3)
    turn[:2, :2] = rotated(np.eye(2), -poses[first, 2]).T
    return first, second, composed(inverse(poses[first]), pose), turn @ information @ turn.T


def _prior(keyframe: Keyframe, pose: np.ndarray, matching: ScanMatching) -> Prior:
    covariance = matching.errors.covariance()
    covariance[POSE, POSE] = np.diag([_PLACE_DEVIATION, _PLACE_DEVIATION, _HEADING_DEVIATION]) ** 2
    covariance[MOTION, MOTION] *= 0.1
    correction = composed(pose, inverse(keyframe.scan.reference_pose))
    return Prior(correction, np.zeros(3), matching.motion, covariance)


def measured_alone(
    result: MatchResult, expected: np.ndarray, prior_covariance: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return the pose (3,) and information (3, 3) that the points alone give: the prior is taken out of the result.

    Directions of which the points say nothing keep the expected pose and no information.
    """
    prior = np.linalg.inv(prior_covariance)
    posterior = np.linalg.inv(result.state_covariance[POSE, POSE])
    values, vectors = np.linalg.eigh(posterior - prior)
    values = np.maximum(values, _LEAST_INFORMATION)
    step = result.pose - expected
    step[2] = float(wrapped(step[2]))
    pull = vectors.T @ (posterior @ step)
    known = values > 1e-3 * values.max()
    offset = vectors @ np.where(known, pull / values, 0.0)
    information = (vectors * np.where(known, values, _LEAST_INFORMATION)) @ vectors.T
    return expected + offset, information


def _joined(found: List[_Edge]) -> RelativePoses:
    count = len(found)
    return RelativePoses(
        np.array([edge[0] for edge in found], dtype=np.int64),
        np.array([edge[1] for edge in found], dtype=np.int64),
        np.array([edge[2] for edge in found]).reshape(count, 3),
        np.array([edge[3] for edge in found]).reshape(count, 3, 3),
        np.zeros(count, dtype=bool),
    )
