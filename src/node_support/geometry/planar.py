"""Planar poses as arrays: x y [m] and yaw [rad] in the last axis; T_a_b takes coordinates in b to coordinates in a."""

from typing import TypeVar

import numpy as np

FULL_TURN = 2.0 * np.pi
Angle = TypeVar("Angle", float, np.ndarray)


def wrapped(angle: Angle) -> Angle:
    """Return an angle, or an array of angles, in [-pi, pi)."""
    return (angle + np.pi) % FULL_TURN - np.pi


def unwrapped(angle: float, near: float) -> float:
    """Return the angle, plus or minus whole turns, that is nearest to `near`."""
    return near + wrapped(angle - near)


def rotated(vectors: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Return vectors (..., 2) turned counter-clockwise by `yaw` (...)."""
    # On a column of a table numpy picks between two sines by where in memory the result lies; they differ in the last
    # bit, so that equal runs would end differently. Contiguous values always take the same one.
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
