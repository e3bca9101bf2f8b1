"""Transforms as 4 x 4 matrices."""

import numpy as np
from geometry_msgs.msg import Pose, Transform

from node_support.errors import RefusedInput
from node_support.geometry.matrices import quaternion_of


def matrix_from_message(transform: Transform) -> np.ndarray:
    """Return the (4, 4) matrix of a transform; raises RefusedInput when it is not finite or no rotation."""
    rotation, shift = transform.rotation, transform.translation
    translation = np.array([shift.x, shift.y, shift.z])
    if not np.isfinite(translation).all():
        raise RefusedInput("transforms refused", f"translation {translation}, must be finite")
    quaternion = np.array([rotation.x, rotation.y, rotation.z, rotation.w])
    matrix = np.eye(4)
    matrix[:3, :3] = matrix_of_quaternion(quaternion, "transforms refused")
    matrix[:3, 3] = translation
    return matrix


def matrix_of_quaternion(quaternion: np.ndarray, kind: str) -> np.ndarray:
    """Return the (3, 3) rotation of a quaternion (4,), x y z w; raises RefusedInput, as `kind`, when it is none."""
    norm = np.linalg.norm(quaternion)
    if not 0.5 < norm < 2.0:
        raise RefusedInput(kind, f"quaternion {quaternion}, must be of length 1")
    x, y, z, w = quaternion / norm
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def pose_from_matrix(matrix: np.ndarray) -> Pose:
    """Return the pose message of a (4, 4) matrix."""
    pose = Pose()
    pose.position.x, pose.position.y, pose.position.z = matrix[:3, 3]
    pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = quaternion_of(matrix)
    return pose
