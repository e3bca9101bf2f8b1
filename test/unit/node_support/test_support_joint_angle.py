"""The angle of a joint, as messages on /joint_states tell it. No ROS master is needed."""

import math

import pytest
import rospy
from sensor_msgs.msg import JointState

from node_support.health import Health
from node_support.ros.transforms import JointAngle


@pytest.fixture
def warnings():
    return []


@pytest.fixture
def servo(warnings, monkeypatch):
    """Return a JointAngle and what hands it messages."""
    callbacks = []
    monkeypatch.setattr(rospy, "Subscriber", lambda topic, kind, callback, **_: callbacks.append(callback))
    angles = []
    joint = JointAngle("servo", Health("test", warnings.append), angles.append)
    return joint, callbacks[0], angles


def test_the_newest_angle_of_the_joint_is_told(servo):
    joint, take, angles = servo
    take(JointState(name=["other", "servo"], position=[0.1, 0.2]))
    take(JointState(name=["other"], position=[0.3]))
    assert (joint.for_beam(), angles) == (0.2, [0.2])


def test_an_angle_that_is_not_finite_is_refused(servo, warnings):
    joint, take, angles = servo
    take(JointState(name=["servo"], position=[0.2]))
    take(JointState(name=["servo"], position=[math.nan]))
    assert (joint.for_beam(), angles) == (0.2, [0.2])
    assert "joint states refused" in warnings[0]


def test_beams_before_the_first_angle_are_counted(servo, warnings):
    assert servo[0].for_beam() == 0.0
    assert "beams of unknown tilt" in warnings[0]


def test_without_a_joint_nothing_is_missed(warnings):
    assert JointAngle("", Health("test", warnings.append)).for_beam() == 0.0
    assert warnings == []
