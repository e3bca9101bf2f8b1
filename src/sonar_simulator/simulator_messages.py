"""What happens at one moment of a simulation, as messages: for publishers and for bags alike."""

from typing import List, Tuple

import numpy as np
import rospy
from genpy import Message
from geometry_msgs.msg import Pose, TransformStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from sonar_processing.transforms import pose_from_matrix
from sonar_simulator.simulation import Moment, Ping
from underwater_map_construction.msg import SonarScanLine

SONAR_FRAME = "sonar"
BASE_FRAME = "base_link"
ODOM_FRAME = "odom"
WORLD_FRAME = "map"
SERVO_JOINT = "sonar_servo_joint"

TOPICS = {
    "/tf": TFMessage,
    "joint_states": JointState,
    "cmd_vel": Twist,
    "odom": Odometry,
    "ground_truth": Odometry,
    "sonar/raw": SonarScanLine,
}
"""Topics, relative to the namespace but for /tf, and their types."""


def moment_messages(moment: Moment, stamp: rospy.Time, max_range: float) -> List[Tuple[str, Message]]:
    """Return (topic, message) pairs, the transform first and the beam last; max_range [m] is the sonar's."""
    odom_pose = pose_from_matrix(moment.T_odom_base)
    twist = _twist(moment.twist)
    messages = [
        ("/tf", TFMessage(transforms=[transform_message(odom_pose, stamp, ODOM_FRAME, BASE_FRAME)])),
        ("joint_states", joint_state(moment.tilt, stamp)),
        ("cmd_vel", twist),
        ("odom", _odometry(odom_pose, twist, stamp, ODOM_FRAME)),
        ("ground_truth", _odometry(pose_from_matrix(moment.T_world_base), Twist(), stamp, WORLD_FRAME)),
    ]
    if moment.ping is not None:
        messages.append(("sonar/raw", _beam(moment.ping, moment.tilt, stamp, max_range)))
    return messages


def transform_message(pose: Pose, stamp: rospy.Time, parent: str, child: str) -> TransformStamped:
    """Return the transform that places `child` at `pose` in `parent`."""
    message = TransformStamped()
    message.header.stamp = stamp
    message.header.frame_id = parent
    message.child_frame_id = child
    message.transform.translation = pose.position
    message.transform.rotation = pose.orientation
    return message


def joint_state(tilt: float, stamp: rospy.Time) -> JointState:
    """Return where the sonar's servo stands, rad."""
    message = JointState(name=[SERVO_JOINT], position=[tilt])
    message.header.stamp = stamp
    return message


def _beam(ping: Ping, tilt: float, stamp: rospy.Time, max_range: float) -> SonarScanLine:
    message = SonarScanLine()
    message.header.stamp = stamp
    message.header.frame_id = SONAR_FRAME
    message.angle = ping.angle
    message.intensities = ping.strengths.tobytes()
    message.maxrange_meters = max_range
    message.range_resolution = max_range / len(ping.strengths)
    message.sensorAngle = tilt
    return message


def _twist(values: np.ndarray) -> Twist:
    message = Twist()
    message.linear.x, message.linear.y, message.linear.z = values[:3]
    message.angular.x, message.angular.y, message.angular.z = values[3:]
    return message


def _odometry(pose: Pose, twist: Twist, stamp: rospy.Time, frame: str) -> Odometry:
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = frame
    message.child_frame_id = BASE_FRAME
    message.pose.pose = pose
    message.twist.twist = twist
    return message
