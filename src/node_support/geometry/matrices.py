"""Poses as 4x4 matrices. T_a_b takes coordinates in frame b to coordinates in frame a; metres, radians."""

import math
from typing import Sequence

import numpy as np

_IDENTITY = np.eye(4)


def pose_matrix(xyz: Sequence[float], rpy: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Return the (4, 4) pose at `xyz` m, turned by `rpy` rad about the fixed axes x, y, z (as SDF does)."""
    angles = np.asarray(rpy, dtype=np.float64)
    # Python multiplies its own numbers several times faster than numpy's.
    (sin_r, sin_p, sin_y), (cos_r, cos_p, cos_y) = np.sin(angles).tolist(), np.cos(angles).tolist()
    pose = _IDENTITY.copy()
    pose[:3, :3] = [
        [cos_y * cos_p, cos_y * sin_p * sin_r - sin_y * cos_r, cos_y * sin_p * cos_r + sin_y * sin_r],
        [sin_y * cos_p, sin_y * sin_p * sin_r + cos_y * cos_r, sin_y * sin_p * cos_r - cos_y * sin_r],
        [-sin_p, cos_p * sin_r, cos_p * cos_r],
    ]
    pose[:3, 3] = xyz
    return pose


def quaternion_of(matrix: np.ndarray) -> np.ndarray:
    """Return the unit quaternion (4,), x y z w, of the rotation in a (3, 3) or (4, 4) matrix.

    Each row of the products is the quaternion times one of its own components; the largest component loses least to
    rounding (Shepperd 1978).
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = matrix[:3, :3].tolist()
    products = [
        [1.0 + xx - yy - zz, xy + yx, xz + zx, zy - yz],
        [xy + yx, 1.0 - xx + yy - zz, yz + zy, xz - zx],
        [xz + zx, yz + zy, 1.0 - xx - yy + zz, yx - xy],
        [zy - yz, xz - zx, yx - xy, 1.0 + xx + yy + zz],
    ]
    diagonal = [products[index][index] for index in range(4)]
    row = np.array(products[diagonal.index(max(diagonal))])
    return row / math.sqrt(row.dot(row))


def quaternions_of(matrices: np.ndarray) -> np.ndarray:
    """Return the unit quaternions (n, 4), x y z w, of the rotations in (n, 3, 3) or (n, 4, 4) matrices."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = np.moveaxis(matrices[:, :3, :3], 0, -1)
    products = np.array(
        [
            [1.0 + xx - yy - zz, xy + yx, xz + zx, zy - yz],
            [xy + yx, 1.0 - xx + yy - zz, yz + zy, xz - zx],
            [xz + zx, yz + zy, 1.0 - xx - yy + zz, yx - xy],
            [zy - yz, xz - zx, yx - xy, 1.0 + xx + yy + zz],
        ]
    )
    largest = np.argmax(np.diagonal(products), axis=1)
    rows = products[largest, :, np.arange(len(matrices))]
    # numpy's dot product adds as in quaternion_of.
    return rows / np.sqrt(rows[:, np.newaxis] @ rows[:, :, np.newaxis])[:, 0]


def yaw_of(pose: np.ndarray) -> float:
    """Return the heading of a (4, 4) pose, rad in [-pi, pi]."""
    return math.atan2(pose[1, 0], pose[0, 0])
