"""Subscriptions to clouds and velocities."""

from typing import Any, Callable, Dict, Tuple

import rospy
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from nav_msgs.msg import Odometry

from node_support.health import Health
from node_support.ros.callbacks import guarded
from sonar_processing.ros.conversions import StampedIntensityCloudArrays
from sonar_processing.scans.moving_state import MovingState
from sonar_processing.scans.parameters import VelocityType

_CLOUD_BUFFER_BYTES = 2**24  # a cloud of a million points; rospy reads one that is larger in pieces, slowly
_QUEUE_SIZE = 10  # scans come every few seconds, and only the newest velocity counts

_VELOCITY_KINDS: Dict[VelocityType, Tuple[type, Callable[[Any], Twist]]] = {
    VelocityType.TWIST: (Twist, lambda message: message),
    VelocityType.TWIST_STAMPED: (TwistStamped, lambda message: message.twist),
    VelocityType.ODOMETRY: (Odometry, lambda message: message.twist.twist),
}


def subscribe_to_clouds(topic: str, callback: Callable[[StampedIntensityCloudArrays], None]) -> rospy.Subscriber:
    """Subscribe to StampedIntensityCloud, with a buffer that holds whole clouds."""
    return rospy.Subscriber(
        topic,
        StampedIntensityCloudArrays,
        callback,
        queue_size=_QUEUE_SIZE,
        buff_size=_CLOUD_BUFFER_BYTES,
        tcp_nodelay=True,
    )


def subscribe_to_velocity(topic: str, kind: VelocityType, state: MovingState, health: Health) -> rospy.Subscriber:
    """Keep `state` informed of the velocities on `topic`."""
    message_type, twist_of = _VELOCITY_KINDS[kind]

    def take(message: Any) -> None:
        health.count("velocities in")
        twist = twist_of(message)
        state.take(_components(twist.linear), _components(twist.angular))

    return rospy.Subscriber(topic, message_type, guarded(health, take), queue_size=_QUEUE_SIZE)


def _components(vector: Vector3) -> Tuple[float, float, float]:
    return vector.x, vector.y, vector.z
