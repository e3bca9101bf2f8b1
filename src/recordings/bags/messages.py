"""Fills in messages of any library, whose fields are named as in their definitions."""

from typing import Any, Callable, List, NamedTuple, Sequence

import numpy as np

from node_support.geometry import quaternion_of


class Placing(NamedTuple):
    """A pose as messages have it: shift (3,) m, turn (4,) unit quaternion, x y z w."""

    shift: Sequence[float]
    turn: Sequence[float]

    @classmethod
    def of(cls, pose: np.ndarray) -> "Placing":
        """Return that of a (4, 4) pose."""
        return cls(pose[:3, 3].tolist(), quaternion_of(pose).tolist())


class Messages:
    """Makes messages; stamps are times of the library."""

    def __init__(self, make: Callable[[str], Any]) -> None:
        """`make` returns a new message of a type, package/Name, with fields of zero."""
        self.make = make

    def stamped(self, kind: str, stamp: Any, frame: str) -> Any:
        message = self.make(kind)
        message.header.stamp, message.header.frame_id = stamp, frame
        return message

    def transforms(self, transforms: List[Any]) -> Any:
        message = self.make("tf2_msgs/TFMessage")
        message.transforms = transforms
        return message

    def transform(self, pose: Placing, stamp: Any, parent: str, child: str) -> Any:
        message = self.stamped("geometry_msgs/TransformStamped", stamp, parent)
        message.child_frame_id = child
        write_pose(message.transform.translation, message.transform.rotation, pose)
        return message

    def odometry(self, pose: Placing, stamp: Any, frame: str, child: str) -> Any:
        """Return the pose of `child` in `frame`, without a velocity."""
        message = self.stamped("nav_msgs/Odometry", stamp, frame)
        message.child_frame_id = child
        write_pose(message.pose.pose.position, message.pose.pose.orientation, pose)
        return message


def write_pose(place: Any, turn: Any, pose: Placing) -> None:
    place.x, place.y, place.z = pose.shift
    turn.x, turn.y, turn.z, turn.w = pose.turn
