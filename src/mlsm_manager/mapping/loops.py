"""Measures keyframes against each other: each against those before it, and against earlier ones of the same place."""

from dataclasses import dataclass
from typing import Callable, List, Optional, Tuple

import numpy as np

from mlsm_manager.blocks import Blocks
from mlsm_manager.mapping.keyframes import Keyframe
from mlsm_manager.mapping.pose_graph import RelativePoses
from mlsm_manager.matching.matcher import Matcher
from mlsm_manager.matching.planar import composed, inverse, rotated, transformed, wrapped
from mlsm_manager.matching.prediction import OdometryErrors
from mlsm_manager.matching.result import MatchResult, Prior
from mlsm_manager.mlsm import MultiLevelSurfaceMap

_SUBMAP = 8
_LOOP_AGE = 12
_LOOP_REACH = 30.0
_LOOP_EVERY = 2
_LEAST_INFORMATION = 1e-9
_PLACE_DEVIATION = 1.0
_HEADING_DEVIATION = 0.0175


@dataclass(frozen=True)
class ScanMatching:
    """How keyframes are matched. resolution: of the submaps, m. motion: (2,) lasting errors of the odometry."""

    matcher: Matcher
    errors: OdometryErrors
    resolution: float
    motion: np.ndarray


def scan_edges(
    keyframes: List[Keyframe], poses: np.ndarray, matching: ScanMatching, on_match: Callable[[int], None]
) -> RelativePoses:
    """Return the edges that matching finds; `on_match` is called with 1 for every keyframe that is done."""
    found: List[Tuple[int, int, np.ndarray, np.ndarray]] = []
    for index in range(1, len(keyframes)):
        groups = [np.arange(max(index - _SUBMAP, 0), index)]
        if index % _LOOP_EVERY == 0:
            groups.append(revisited(poses, index))
        for group in groups:
            edge = _edge(keyframes, poses, index, group, matching) if len(group) else None
            if edge is not None:
                found.append(edge)
        on_match(1)
    return _joined(found)


def revisited(poses: np.ndarray, index: int) -> np.ndarray:
    """Return the earlier keyframes (at most eight, nearest first) near keyframe `index` that are not its predecessors.

    poses: (k, 3). Nearest first, none if fewer than three are within 30 m.
    """
    earlier = poses[: max(index - _LOOP_AGE, 0), :2]
    distance = np.hypot(*(earlier - poses[index, :2]).T)
    near = np.argsort(distance)[:_SUBMAP]
    near = near[distance[near] < _LOOP_REACH]
    return near if len(near) >= 3 else near[:0]


def _edge(
    keyframes: List[Keyframe], poses: np.ndarray, index: int, group: np.ndarray, matching: ScanMatching
) -> Optional[Tuple[int, int, np.ndarray, np.ndarray]]:
    anchor = int(group[np.argmin(np.abs(group - index))])
    prior = _prior(keyframes[index], poses[index], matching)
    result = matching.matcher.match(keyframes[index].scan, _submap(keyframes, poses, group, matching), prior)
    if not result.accepted:
        return None
    pose, information = measured_alone(result, poses[index], prior.covariance[:3, :3])
    relative = composed(inverse(poses[anchor]), pose)
    turn = np.eye(3)
    turn[:2, :2] = rotated(np.eye(2), -poses[anchor, 2]).T
    return anchor, index, relative, turn @ information @ turn.T


def _prior(keyframe: Keyframe, pose: np.ndarray, matching: ScanMatching) -> Prior:
    covariance = matching.errors.covariance()
    covariance[:3, :3] = np.diag([_PLACE_DEVIATION, _PLACE_DEVIATION, _HEADING_DEVIATION]) ** 2
    covariance[6:, 6:] *= 0.1
    correction = composed(pose, inverse(keyframe.scan.reference_pose))
    return Prior(correction, np.zeros(3), matching.motion, covariance)


def _submap(keyframes: List[Keyframe], poses: np.ndarray, group: np.ndarray, matching: ScanMatching) -> Blocks:
    surfaces = MultiLevelSurfaceMap(matching.resolution)
    surfaces.insert(np.concatenate([transformed(poses[one], keyframes[one].seen) for one in group]))
    return surfaces.blocks


def measured_alone(
    result: MatchResult, expected: np.ndarray, prior_covariance: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return the pose (3,) and information (3, 3) that the points alone give: the prior is taken out of the result.

    Directions of which the points say nothing keep the expected pose and no information.
    """
    prior = np.linalg.inv(prior_covariance)
    posterior = np.linalg.inv(result.state_covariance[:3, :3])
    values, vectors = np.linalg.eigh(posterior - prior)
    values = np.maximum(values, _LEAST_INFORMATION)
    step = result.pose - expected
    step[2] = float(wrapped(step[2]))
    pull = vectors.T @ (posterior @ step)
    known = values > 1e-3 * values.max()
    offset = vectors @ np.where(known, pull / values, 0.0)
    information = (vectors * np.where(known, values, _LEAST_INFORMATION)) @ vectors.T
    return expected + offset, information


def _joined(found: List[Tuple[int, int, np.ndarray, np.ndarray]]) -> RelativePoses:
    count = len(found)
    return RelativePoses(
        np.array([edge[0] for edge in found], dtype=np.int64),
        np.array([edge[1] for edge in found], dtype=np.int64),
        np.array([edge[2] for edge in found]).reshape(count, 3),
        np.array([edge[3] for edge in found]).reshape(count, 3, 3),
        np.zeros(count, dtype=bool),
    )
