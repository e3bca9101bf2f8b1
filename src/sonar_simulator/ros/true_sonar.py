"""Tells an emulated head, and rviz, where the simulated sonar truly is."""

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped

from node_support.ros.transforms import pose_from_matrix
from sonar_simulator.simulation.moment_messages import MAP_FRAME

WORLD_FRAME = "world"
TRUE_SONAR_FRAME = "true_sonar"


class TrueSonar:
    """Publishes world -> true_sonar, and world -> map as where the vehicle's map begins, so that both have one root."""

    def __init__(self, origin: np.ndarray) -> None:
        """origin: (3,) m, of the map in the world."""
        self._broadcaster = tf2_ros.TransformBroadcaster()
        self._T_world_map = np.eye(4)
        self._T_world_map[:3, 3] = origin

    def publish(self, T_world_sonar: np.ndarray, stamp: rospy.Time) -> None:
        """Publish where the sonar is, (4, 4)."""
        poses = {TRUE_SONAR_FRAME: T_world_sonar, MAP_FRAME: self._T_world_map}
        self._broadcaster.sendTransform([_transform(frame, pose, stamp) for frame, pose in poses.items()])


def _transform(frame: str, T_world_frame: np.ndarray, stamp: rospy.Time) -> TransformStamped:
    message = TransformStamped(child_frame_id=frame)
    message.header.stamp, message.header.frame_id = stamp, WORLD_FRAME
    pose = pose_from_matrix(T_world_frame)
    message.transform.translation, message.transform.rotation = pose.position, pose.orientation
    return message
