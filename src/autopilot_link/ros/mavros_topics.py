"""Hands positions to MAVROS, which turns them into MAVLink's axes and time."""

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry

from autopilot_link.parameters import AutopilotLinkParameters, PoseMessage
from autopilot_link.protocol import StatedPose
from node_support import topics
from node_support.ros.transforms import pose_from_matrix


class MavrosTopics:
    """Stands where an AutopilotLink would; MAVROS takes no reset counter."""

    name = "MAVROS"

    def __init__(self, parameters: AutopilotLinkParameters) -> None:
        """Publish one of the topics that MAVROS takes."""
        self._frames = parameters.map_frame, parameters.base_frame
        if parameters.message is PoseMessage.ODOMETRY:
            self._publisher = rospy.Publisher(topics.MAVROS_ODOMETRY, Odometry, queue_size=10)
        else:
            self._publisher = rospy.Publisher(topics.MAVROS_POSE, PoseWithCovarianceStamped, queue_size=10)

    def obstacle(self) -> str:
        """Return why no position can be sent now; empty when one can."""
        return "" if self._publisher.get_num_connections() else f"nobody listens to {self._publisher.resolved_name}"

    def send(self, pose: StatedPose) -> None:
        """Publish a position."""
        message = self._publisher.data_class()
        message.header.stamp = rospy.Time(*divmod(pose.stamp_ns, 10**9))
        message.header.frame_id = self._frames[0]
        message.pose.pose = pose_from_matrix(pose.T_enu_base)
        message.pose.covariance = pose.covariance.ravel().tolist()
        if isinstance(message, Odometry):
            message.child_frame_id = self._frames[1]
            linear, angular = message.twist.twist.linear, message.twist.twist.angular
            linear.x, linear.y, linear.z = pose.velocity
            angular.x = angular.y = angular.z = np.nan
            message.twist.covariance[0] = np.nan
        self._publisher.publish(message)
