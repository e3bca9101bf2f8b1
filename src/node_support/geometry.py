"""Poses, bearings, and the square cells of grids, as arrays; metres, radians.

T_a_b takes coordinates in frame b to coordinates in frame a. Planar poses hold x, y and yaw in their last axis; poses
in space are 4x4 matrices.
"""

import math
from typing import Sequence, Tuple, TypeVar

import numpy as np

FULL_TURN = 2.0 * np.pi
Angle = TypeVar("Angle", float, np.ndarray)


def wrapped(angle: Angle) -> Angle:
    """Return an angle, or an array of angles, in [-pi, pi)."""
    return (angle + np.pi) % FULL_TURN - np.pi


def harmonics(angles: np.ndarray) -> np.ndarray:
    """Return cosines and sines (n, 4) of angles (n,) [rad] and of twice the angles."""
    return np.column_stack([part(times * angles) for times in (1.0, 2.0) for part in (np.cos, np.sin)])


def grid(line: np.ndarray) -> np.ndarray:
    """Return the points (n, 2) of a square grid with sides `line`."""
    return np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)


def cells_of(points: np.ndarray, side: float) -> np.ndarray:
    """Return (n, 2) int64 cell indices of points (n, >= 2), floor(x / side), floor(y / side) as in thesis 6.5.6."""
    return np.floor(points[:, :2] / side).astype(np.int64)


def cell_keys(cells: np.ndarray) -> np.ndarray:
    """Return (n,) int64, one key per cell; cells is (n, 2) int64 with |index| < 2**31. Keys sort by x, then by y."""
    return (cells[:, 0] << 32) + cells[:, 1]


def cells_of_keys(keys: np.ndarray) -> np.ndarray:
    """Return the (n, 2) int64 cells whose keys `cell_keys` gave."""
    low = ((keys & 0xFFFFFFFF) ^ 0x80000000) - 0x80000000
    return np.column_stack([(keys - low) >> 32, low])


def keys_of(points: np.ndarray, side: float) -> np.ndarray:
    """Return (n,) int64, the keys of the cells of points (n, >= 2)."""
    return cell_keys(cells_of(points, side))


def squares_of(places: np.ndarray, side: float) -> np.ndarray:
    """Return the number (n,), from 0 on, of the cell that each of `places` (n, >= 2) lies in."""
    return np.unique(keys_of(places, side), return_inverse=True)[1]


def members(sizes: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the group (n,) of each member of groups with `sizes` (g,), one after the other, and its number in it."""
    groups = np.repeat(np.arange(len(sizes)), sizes)
    return groups, np.arange(len(groups)) - np.repeat(np.cumsum(sizes) - sizes, sizes)


def bearings_of(vectors: np.ndarray) -> np.ndarray:
    """Return the angles (...) [rad] of vectors (..., >= 2), counter-clockwise from x."""
    # Of columns of a table numpy picks one of two functions by where in memory the result lies; they differ in the last
    # bit, so that equal runs would end differently. Contiguous values always take the same one.
    return np.arctan2(*(np.asarray(vectors[..., axis], order="C") for axis in (1, 0)))


def rotated(vectors: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Return vectors (..., 2) turned counter-clockwise by `yaw` (...)."""
    # Contiguous as in bearings_of.
    yaw = np.asarray(yaw, order="C")
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y = vectors[..., 0], vectors[..., 1]
    first = cos * x - sin * y
    result = np.empty((*np.shape(first), 2))
    result[..., 0] = first
    result[..., 1] = sin * x + cos * y
    return result


def composed(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return T_a_c (..., 3) of `first` = T_a_b and `second` = T_b_c; the yaw is not wrapped."""
    first, second = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    position = first[..., :2] + rotated(second[..., :2], first[..., 2])
    return np.concatenate([position, (first[..., 2] + second[..., 2])[..., np.newaxis]], axis=-1)


def inverse(pose: np.ndarray) -> np.ndarray:
    """Return T_b_a (..., 3) of T_a_b."""
    pose = np.asarray(pose, dtype=np.float64)
    position = -rotated(pose[..., :2], -pose[..., 2])
    return np.concatenate([position, -pose[..., 2, np.newaxis]], axis=-1)


def seen_from(pose: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return T_b_c (..., 3) of `pose` = T_a_b and `other` = T_a_c."""
    return composed(inverse(pose), other)


def move_of(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return what takes a pose to where it is afterwards: T_map_odom (..., 3) of T_odom_base and T_map_base."""
    return composed(after, inverse(before))


def transformed(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points (n, >= 2) with x y taken through T_a_b (3,) or (n, 3), further columns as they are."""
    pose = np.asarray(pose, dtype=np.float64)
    result = np.array(points, dtype=np.float64)
    result[:, :2] = pose[..., :2] + rotated(result[:, :2], pose[..., 2])
    return result


def matrices(pose: np.ndarray) -> np.ndarray:
    """Return T_a_b (..., 3) as (..., 4, 4), at the same height and level."""
    pose = np.asarray(pose, dtype=np.float64)
    result = np.zeros((*pose.shape[:-1], 4, 4))
    result[..., :2, 0] = rotated(np.array([1.0, 0.0]), pose[..., 2])
    result[..., :2, 1] = rotated(np.array([0.0, 1.0]), pose[..., 2])
    result[..., :2, 3] = pose[..., :2]
    result[..., 2, 2] = result[..., 3, 3] = 1.0
    return result


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


def rotation_matrices(quaternions: np.ndarray) -> np.ndarray:
    """Return (n, 3, 3) rotations of unit quaternions (n, 4), x y z w."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)


def yaw_of(pose: np.ndarray) -> float:
    """Return the heading of a (4, 4) pose, rad in [-pi, pi]."""
    return math.atan2(pose[1, 0], pose[0, 0])
