"""The state at one moment of a simulation as messages, for publishers and for bags."""

from typing import List, Tuple

import numpy as np
import rospy
from genpy import Message
from geometry_msgs.msg import Pose, TransformStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64, Header
from tf2_msgs.msg import TFMessage

from node_support import topics
from node_support.ros.conversions import pose_from_matrix
from sonar_simulator.simulation.simulation import Instruments, Moment, Ping
from sonar_simulator.simulation.simulation_setup import BASE_FRAME, SONAR_FRAME
from underwater_map_construction.msg import SonarScanLine

ODOM_FRAME = "odom"
WORLD_FRAME = "map"
SERVO_JOINT = "sonar_servo_joint"

_ALWAYS = {
    topics.JOINT_STATES: JointState,
    topics.VELOCITY: Twist,
    topics.GROUND_TRUTH: Odometry,
    topics.BEAMS: SonarScanLine,
}
TOPICS = {
    Instruments.DVL: {topics.TRANSFORMS: TFMessage, topics.ODOMETRY: Odometry, **_ALWAYS},
    Instruments.COMPASS: {topics.HEADING: Imu, topics.DEPTH: Float64, **_ALWAYS},
}
"""Topics and their types; relative to the namespace, except /tf."""


def moment_messages(
    moment: Moment, stamp: rospy.Time, max_range: float, instruments: Instruments = Instruments.DVL
) -> List[Tuple[str, Message]]:
    """Return (topic, message) pairs, the transform first; max_range [m] is the sonar's.

    Transform and joint are part of every moment, so that a beam can be placed at its own stamp; the rest is part of
    ticks only, at the steady rate of an instrument.
    """
    messages = placing_messages(moment, stamp, instruments)
    if moment.is_tick:
        messages += _measured(moment, stamp, instruments)
    if moment.ping is not None:
        header = Header(stamp=stamp, frame_id=SONAR_FRAME)
        messages.append((topics.BEAMS, scan_line(moment.ping, moment.tilt, header, max_range)))
    return messages


def _measured(moment: Moment, stamp: rospy.Time, instruments: Instruments) -> List[Tuple[str, Message]]:
    velocity, true_velocity = _twist(moment.odometry.twist), _twist(moment.truth.twist)
    true_pose = pose_from_matrix(moment.truth.T_world_base)
    messages = [(topics.GROUND_TRUTH, _odometry(true_pose, true_velocity, stamp, WORLD_FRAME))]
    if instruments is Instruments.DVL:
        odom_pose = pose_from_matrix(moment.odometry.T_odom_base)
        messages.append((topics.ODOMETRY, _odometry(odom_pose, velocity, stamp, ODOM_FRAME)))
    return [(topics.VELOCITY, velocity), *messages]


def placing_messages(
    moment: Moment, stamp: rospy.Time, instruments: Instruments = Instruments.DVL
) -> List[Tuple[str, Message]]:
    """Return the (topic, message) pairs that place vehicle and sonar, the transform, if there is one, first."""
    pose = pose_from_matrix(moment.odometry.T_odom_base)
    joint = (topics.JOINT_STATES, joint_state(moment.tilt, stamp))
    if instruments is Instruments.DVL:
        transforms = TFMessage(transforms=[transform_message(pose, stamp, ODOM_FRAME, BASE_FRAME)])
        return [(topics.TRANSFORMS, transforms), joint]
    if not moment.is_tick:
        return [joint]
    heading = Imu(header=Header(stamp=stamp, frame_id=BASE_FRAME), orientation=pose.orientation)
    return [(topics.HEADING, heading), (topics.DEPTH, Float64(data=-pose.position.z)), joint]


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
    """Return the position of the sonar's servo, rad."""
    message = JointState(name=[SERVO_JOINT], position=[tilt])
    message.header.stamp = stamp
    return message


def scan_line(ping: Ping, tilt: float, header: Header, max_range: float) -> SonarScanLine:
    """Return the message of a beam; `tilt` [rad] is that of the sonar's servo, `max_range` [m] the last bin's end."""
    return SonarScanLine(
        header=header,
        angle=ping.angle,
        intensities=ping.strengths.tobytes(),
        maxrange_meters=max_range,
        range_resolution=max_range / len(ping.strengths),
        sensorAngle=tilt,
    )


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
