"""Sends map -> odom at a steady rate (REP-105)."""

from typing import Callable

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped

from mlsm_manager.localisation.parameters import MlsmCoreParameters
from node_support.headers import check_stamp
from node_support.health import Health
from node_support.ros.callbacks import every_clock_period


class MapTransform:
    """The correction that tf knows as map -> odom."""

    def __init__(
        self, parameters: Callable[[], MlsmCoreParameters], correction: Callable[[], np.ndarray], health: Health
    ) -> None:
        """`parameters` and `correction`, T_map_odom (3,), return what holds now."""
        self._parameters = parameters
        self._correction = correction
        self._health = health
        self._broadcaster = tf2_ros.TransformBroadcaster()
        self._last_stamp = rospy.Time(0)
        every_clock_period(1.0 / parameters().transform_rate, self._send, health)

    def _send(self) -> None:
        parameters = self._parameters()
        stamp = rospy.Time.now() + rospy.Duration(parameters.transform_tolerance)
        if stamp == self._last_stamp:
            return
        check_stamp(stamp.to_nsec())
        self._last_stamp = stamp
        x, y, yaw = self._correction()
        message = TransformStamped()
        message.header.stamp = stamp
        message.header.frame_id = parameters.map_frame
        message.child_frame_id = parameters.odom_frame
        message.transform.translation.x, message.transform.translation.y = x, y
        message.transform.rotation.z, message.transform.rotation.w = np.sin(yaw / 2.0), np.cos(yaw / 2.0)
        self._broadcaster.sendTransform(message)
        self._health.count("transforms sent")
