"""Velocities in the messages of different instruments."""

from types import SimpleNamespace as Message

import numpy as np
import pytest

from dead_reckoning.velocity_messages import VELOCITY_TYPES, velocity_type
from node_support.errors import RefusedInput

HEADER = Message(stamp=Message(secs=5, nsecs=7), frame_id="/dvl")
LINEAR = Message(linear=Message(x=0.5, y=-0.1, z=0.2))
VECTOR = LINEAR.linear


def report(valid=True):
    return Message(timestamp=1, report=Message(vx=0.5, vy=-0.1, vz=0.2, velocity_valid=valid))


MESSAGES = {
    "geometry_msgs/TwistStamped": Message(header=HEADER, twist=LINEAR),
    "geometry_msgs/TwistWithCovarianceStamped": Message(header=HEADER, twist=Message(twist=LINEAR)),
    "nav_msgs/Odometry": Message(header=HEADER, child_frame_id="dvl", twist=Message(twist=LINEAR)),
    "waterlinked_a50_ros_driver/DVL": Message(header=HEADER, velocity=VECTOR, velocity_valid=True),
    "marine_acoustic_msgs/Dvl": Message(header=HEADER, velocity=VECTOR, beam_velocities_valid=True),
    "cola2_msgs/DVL": Message(header=HEADER, velocity=VECTOR, velocity_covariance=np.zeros(9)),
    "nortek_dvl/Dvl": Message(header=HEADER, velocity=VECTOR),
}


@pytest.mark.parametrize("name", MESSAGES)
def test_velocity_stamp_and_frame_are_read(name):
    found = VELOCITY_TYPES[name].fields(MESSAGES[name])
    assert (found.stamp_ns, found.frame_id, found.velocity.tolist()) == (5_000_000_007, "dvl", [0.5, -0.1, 0.2])


def test_a_report_without_a_header_has_neither_stamp_nor_frame():
    found = VELOCITY_TYPES["waterlinked_a50/TransducerReportStamped"].fields(report())
    assert (found.stamp_ns, found.frame_id, found.velocity.tolist()) == (0, "", [0.5, -0.1, 0.2])


@pytest.mark.parametrize(
    ("name", "expected"), [("nortek_dvl/Dvl", [0.5, 0.1, -0.2]), ("nav_msgs/Odometry", [0.5, -0.1, 0.2])]
)
def test_a_dvl_s_own_axes_count_right_and_down(name, expected):
    kind = VELOCITY_TYPES[name]
    assert kind.in_vehicle(kind.fields(MESSAGES[name]), None)[0].tolist() == expected


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("waterlinked_a50/TransducerReportStamped", report(valid=False)),
        ("waterlinked_a50_ros_driver/DVL", Message(header=HEADER, velocity=VECTOR, velocity_valid=False)),
        ("marine_acoustic_msgs/Dvl", Message(header=HEADER, velocity=VECTOR, beam_velocities_valid=False)),
        ("cola2_msgs/DVL", Message(header=HEADER, velocity=VECTOR, velocity_covariance=-np.ones(9))),
        ("nortek_dvl/Dvl", Message(header=HEADER, velocity=Message(x=np.nan, y=0.0, z=0.0))),
        ("nav_msgs/Odometry", Message(header=HEADER)),
    ],
)
def test_a_message_that_says_no_velocity_is_refused(name, message):
    with pytest.raises(RefusedInput):
        VELOCITY_TYPES[name].fields(message)


def test_a_type_that_is_not_read_is_refused_by_its_name():
    with pytest.raises(RefusedInput, match="geometry_msgs/Twist is not read as a velocity"):
        velocity_type("geometry_msgs/Twist")
