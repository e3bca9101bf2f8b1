"""Scans with their places, as the smoothing takes them."""

from dataclasses import dataclass
from typing import List

import numpy as np

from mlsm_manager.localisation.mapper import ScanUpdate
from mlsm_manager.matching.problem.result import corrected_points
from mlsm_manager.matching.problem.scan import Scan, Track
from mlsm_manager.matching.problem.state import POSE
from node_support.geometry.planar import composed, inverse, transformed, wrapped


@dataclass(frozen=True)
class Keyframe:
    """scan: its points and odometry. seen: (n, 4) points undistorted, in base_link at the scan's reference time.

    pose: (3,) T_map_base then, as it was known then.
    """

    scan: Scan
    seen: np.ndarray
    pose: np.ndarray

    @property
    def time(self) -> float:
        """Reference time of the scan, s."""
        return self.scan.reference_time


def keyframes_of(updates: List[ScanUpdate]) -> List[Keyframe]:
    """Return the keyframes of all scans that are in the map, at increasing times."""
    keyframes: List[Keyframe] = []
    for update in updates:
        if update.accepted and (not keyframes or update.scan.reference_time > keyframes[-1].time):
            keyframes.append(_keyframe(update))
    return keyframes


def _keyframe(update: ScanUpdate) -> Keyframe:
    scan, pose = update.scan, update.belief.theta[POSE]
    if update.result is None:
        points = transformed(composed(pose, inverse(scan.reference_pose)), scan.points)
    else:
        points, pose = corrected_points(scan, update.result), update.result.pose
    return Keyframe(scan, transformed(inverse(pose), points), pose)


def path_through(poses: np.ndarray, times: np.ndarray, motion: np.ndarray, track: Track) -> np.ndarray:
    """Return T_map_base (m, 3) at the track's times: through keyframes `poses` (k, 3) at `times` (k,) s.

    Between keyframes the odometry says the shape, with its lasting errors `motion` (2,) taken off, and what is left to
    the next keyframe is spread over the time between. Before the first and after the last nothing is left.
    """
    owner = np.clip(np.searchsorted(times, track.times, side="right") - 1, 0, len(times) - 1)
    known = track.at(times)
    guess = composed(poses[owner], _relative(known[owner], track.poses, motion))
    following = np.minimum(owner + 1, len(times) - 1)
    expected = composed(poses[owner], _relative(known[owner], known[following], motion))
    left = poses[following] - expected
    left[:, 2] = wrapped(left[:, 2])
    span = np.maximum(times[following] - times[owner], 1e-9)
    share = np.clip((track.times - times[owner]) / span, 0.0, 1.0) * (following > owner)
    return guess + share[:, np.newaxis] * left


def _relative(start: np.ndarray, end: np.ndarray, motion: np.ndarray) -> np.ndarray:
    relative = composed(inverse(start), end)
    cos, sin = np.cos(motion[1]), np.sin(motion[1])
    turn = (1.0 + motion[0]) * np.array([[cos, -sin], [sin, cos]])
    return np.column_stack([relative[:, :2] @ turn.T, relative[:, 2]])
