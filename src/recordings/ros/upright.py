"""Messages of an odometry that counts x north, y east, z down, turned into x, y left, z up (REP-103)."""

from typing import Any, Union

from geometry_msgs.msg import Quaternion, Vector3


def turn_up(message: Any, odom_frame: str, base_frame: str) -> bool:
    """Turn what a TFMessage or Odometry says of the vehicle in odom, both frames by half a turn about x.

    Return whether there was such a pose; other messages stay as they are.
    """
    poses = [
        (one.transform.translation, one.transform.rotation)
        for one in getattr(message, "transforms", ())
        if (one.header.frame_id.lstrip("/"), one.child_frame_id.lstrip("/")) == (odom_frame, base_frame)
    ]
    if hasattr(message, "pose") and hasattr(message, "twist"):
        poses.append((message.pose.pose.position, message.pose.pose.orientation))
        for velocity in (message.twist.twist.linear, message.twist.twist.angular):
            _turn(velocity)
    for position, orientation in poses:
        _turn(position)
        _turn(orientation)
    return bool(poses)


def _turn(value: Union[Vector3, Quaternion]) -> None:
    value.y, value.z = -value.y, -value.z
