"""Listens to whichever kind of message tells how fast the vehicle is."""

from typing import Any, Callable, Dict, Tuple

import rospy
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from nav_msgs.msg import Odometry

from node_support.health import Health
from node_support.ros.node import guarded
from sonar_processing.scans.moving_state import Motion
from sonar_processing.scans.parameters import VelocityType

_KINDS: Dict[VelocityType, Tuple[type, Callable[[Any], Twist]]] = {
    VelocityType.TWIST: (Twist, lambda message: message),
    VelocityType.TWIST_STAMPED: (TwistStamped, lambda message: message.twist),
    VelocityType.ODOMETRY: (Odometry, lambda message: message.twist.twist),
}


def subscribe_to_velocity(topic: str, kind: VelocityType, motion: Motion, health: Health) -> rospy.Subscriber:
    """Keep `motion` informed of the velocities on `topic`."""
    message_type, twist_of = _KINDS[kind]

    def take(message: Any) -> None:
        health.count("velocities in")
        twist = twist_of(message)
        motion.take(_components(twist.linear), _components(twist.angular))

    return rospy.Subscriber(topic, message_type, guarded(health, take), queue_size=10)


def _components(vector: Vector3) -> Tuple[float, float, float]:
    return vector.x, vector.y, vector.z
