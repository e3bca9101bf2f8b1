"""Poses as 4x4 matrices. T_a_b takes coordinates in frame b to coordinates in frame a; metres, radians."""

import math
from typing import Sequence

import numpy as np


def pose_matrix(xyz: Sequence[float], rpy: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Return the (4, 4) pose at `xyz` m, turned by `rpy` rad about the fixed axes x, y, z (as SDF does)."""
    (sin_r, sin_p, sin_y), (cos_r, cos_p, cos_y) = np.sin(rpy), np.cos(rpy)
    pose = np.eye(4)
    pose[:3, :3] = [
        [cos_y * cos_p, cos_y * sin_p * sin_r - sin_y * cos_r, cos_y * sin_p * cos_r + sin_y * sin_r],
        [sin_y * cos_p, sin_y * sin_p * sin_r + cos_y * cos_r, sin_y * sin_p * cos_r - cos_y * sin_r],
        [-sin_p, cos_p * sin_r, cos_p * cos_r],
    ]
    pose[:3, 3] = xyz
    return pose


def yaw_of(pose: np.ndarray) -> float:
    """Return the heading of a (4, 4) pose, rad in [-pi, pi]."""
    return math.atan2(pose[1, 0], pose[0, 0])
