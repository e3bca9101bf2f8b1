"""What REP-103, REP-105 and robot_localization demand of poses and transforms, as checks that raise AssertionError."""

from typing import Any, Dict, Sequence

import numpy as np

from node_support.ros.transforms import matrix_from_message

_PLANAR, _UNMEASURED = [0, 1, 5], [2, 3, 4]


def check_poses(messages: Sequence[Any], frame: str, child: str = "") -> None:
    """Check poses, or odometries of `child`, in `frame`, in the order in which they came."""
    stamps = [message.header.stamp.to_nsec() for message in messages]
    assert [0, *stamps] == sorted({0, *stamps}), f"0, or not increasing: {stamps}"
    for message in messages:
        orientation = message.pose.pose.orientation
        length = np.linalg.norm([orientation.x, orientation.y, orientation.z, orientation.w])
        assert abs(length - 1.0) < 1e-3, f"quaternion of length {length:g}"
        assert (message.header.frame_id, getattr(message, "child_frame_id", "")) == (frame, child), message
        _check_covariance(message.pose.covariance)
        if child:
            _check_covariance(message.twist.covariance)


def _check_covariance(entries: Sequence[float]) -> None:
    """Six axes x, y, z and the rotations about them, row by row: what is measured is known, but not perfectly."""
    matrix = np.reshape(entries, (6, 6))
    assert np.allclose(matrix, matrix.T), f"not finite or not symmetric: {matrix}"
    assert np.linalg.eigvalsh(matrix)[0] > 0.0, matrix
    assert matrix.diagonal()[_PLANAR].max() < matrix.diagonal()[_UNMEASURED].min(), matrix


def check_tree(transforms: Sequence[Any]) -> None:
    """Check that no frame of transforms has two parents, and that odom is level."""
    parents: Dict[str, str] = {}
    for one in transforms:
        assert parents.setdefault(one.child_frame_id, one.header.frame_id) == one.header.frame_id, one
        assert one.child_frame_id != "odom" or np.isclose(matrix_from_message(one.transform)[2, 2], 1.0), one
