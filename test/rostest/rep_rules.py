"""What REP-103, REP-105 and robot_localization demand of poses and transforms, as checks of messages."""

from typing import Any, Dict, List, Sequence

import numpy as np

from node_support.geometry import yaw_of
from node_support.ros.transforms import matrix_from_message

_UNIT = 1e-3  # by which a quaternion's length may differ from 1
_PLANAR = [0, 1, 5]


def broken_rules(messages: Sequence[Any], frame: str, child: str = "") -> List[str]:
    """Return what is wrong with poses, or odometries of `child`, in `frame`, in the order in which they came."""
    found: List[str] = []
    for number, message in enumerate(messages):
        found += [f"message {number}: {rule}" for rule in _broken_by(message, frame, child)]
    stamps = [message.header.stamp.to_nsec() for message in messages]
    if any(later <= earlier for earlier, later in zip(stamps, stamps[1:])):
        found.append("stamps do not increase")
    return found


def _broken_by(message: Any, frame: str, child: str) -> List[str]:
    orientation = message.pose.pose.orientation
    length = np.linalg.norm([orientation.x, orientation.y, orientation.z, orientation.w])
    rules = {
        f"frame {message.header.frame_id!r}, must be {frame!r}": message.header.frame_id == frame,
        "stamp 0": message.header.stamp.to_nsec() > 0,
        f"quaternion of length {length:g}": abs(length - 1.0) < _UNIT,
        **_covariance_rules("pose", message.pose.covariance),
    }
    if child:
        rules[f"child frame {message.child_frame_id!r}, must be {child!r}"] = message.child_frame_id == child
        rules.update(_covariance_rules("twist", message.twist.covariance))
    return [rule for rule, holds in rules.items() if not holds]


def _covariance_rules(name: str, entries: Sequence[float]) -> Dict[str, bool]:
    """Six axes x, y, z and the rotations about them, row by row: what is measured is known, but not perfectly."""
    matrix = np.reshape(entries, (6, 6))
    finite = bool(np.isfinite(matrix).all())
    variances = matrix.diagonal()
    return {
        f"{name} covariance not finite": finite,
        f"{name} covariance not symmetric": not finite or np.allclose(matrix, matrix.T),
        f"{name} covariance not positive": not finite or np.linalg.eigvalsh((matrix + matrix.T) / 2.0)[0] > 0.0,
        f"{name} x, y or yaw less known than z, roll or pitch, which nothing measures": not finite
        or variances[_PLANAR].max() < variances[[2, 3, 4]].min(),
    }


def broken_tree(transforms: Sequence[Any]) -> List[str]:
    """Return which frames of transforms have two parents, and where odom is not level."""
    parents: Dict[str, set] = {}
    found = []
    for one in transforms:
        parents.setdefault(one.child_frame_id, set()).add(one.header.frame_id)
        matrix = matrix_from_message(one.transform)
        if one.child_frame_id == "odom" and not np.isclose(matrix[2, 2], 1.0):
            found.append(f"odom is tilted in {one.header.frame_id}, heading {yaw_of(matrix):.2f} rad")
    return found + [f"{child} has the parents {sorted(names)}" for child, names in parents.items() if len(names) > 1]
