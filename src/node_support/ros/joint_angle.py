"""The angle of one joint, as /joint_states tells it."""

import math
from typing import Callable, Optional

import rospy
from sensor_msgs.msg import JointState

from node_support import topics
from node_support.errors import RefusedInput
from node_support.health import Health
from node_support.ros.node import guarded


class JointAngle:
    """Remembers the newest angle of a joint, and calls back with it."""

    def __init__(self, joint: str, health: Health, on_angle: Callable[[float], None] = lambda angle: None) -> None:
        """`joint`: its name in /joint_states; empty where there is none. `on_angle` takes every angle, rad."""
        self._joint = joint
        self._health = health
        self._on_angle = on_angle
        self._angle: Optional[float] = None
        if joint:
            rospy.Subscriber(topics.JOINT_STATES, JointState, guarded(health, self._take), queue_size=10)

    def for_beam(self) -> float:
        """Return the angle that a beam carries, rad: 0 without a joint, or, which is counted, before it was heard."""
        if self._joint and self._angle is None:
            detail = f"joint {self._joint!r} is not in /{topics.JOINT_STATES}; sensorAngle is 0"
            self._health.problem("beams of unknown tilt", detail)
        return self._angle or 0.0

    def _take(self, joints: JointState) -> None:
        angle = dict(zip(joints.name, joints.position)).get(self._joint)
        if angle is None:
            return
        if not math.isfinite(angle):
            raise RefusedInput("joint states refused", f"{self._joint} at {angle} rad, must be finite")
        self._angle = angle
        self._on_angle(angle)
