"""The messages of a simulation for publishers."""

from typing import Dict

from genpy import Message
from geometry_msgs.msg import TransformStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64
from tf2_msgs.msg import TFMessage

from sonar_simulator.simulation.moment_messages import MomentMessages
from underwater_map_construction.msg import SonarScanLine

CLASSES: Dict[str, type] = {
    kind._type: kind for kind in (Float64, Imu, JointState, Odometry, SonarScanLine, TFMessage, TransformStamped, Twist)
}
"""By their names."""


def _made(kind: str) -> Message:
    return CLASSES[kind]()


MESSAGES = MomentMessages(_made, lambda values: values.tobytes())
"""Fills in messages of rospy."""
