"""Messages to bytes, as rosbags itself does it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype

from recordings.bags.blank_message import blank_message
from recordings.bags.message_bytes import MessageBytesError, serializer
from recordings.bags.message_types import BEAM_TYPE, ros1_types

TYPES = [
    BEAM_TYPE, "tf2_msgs/msg/TFMessage", "nav_msgs/msg/Odometry", "sensor_msgs/msg/JointState", "std_msgs/msg/String",
    "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/CameraInfo", "std_msgs/msg/Empty",
    "diagnostic_msgs/msg/DiagnosticArray", "visualization_msgs/msg/Marker", "std_msgs/msg/Bool",
]  # fmt: skip


def _fill(message, name, rng):
    """Give all fields of a message random values, and sequences a random length."""
    for field, (node, detail) in ros1_types().FIELDDEFS[name][1]:
        if node == Nodetype.NAME:
            _fill(getattr(message, field), detail, rng)
        elif node == Nodetype.BASE:
            setattr(message, field, _value(getattr(message, field), rng))
        else:
            length = detail[1] if node == Nodetype.ARRAY else rng.randint(0, 4)
            setattr(message, field, _values(getattr(message, field), detail[0], length, rng))
    return message


def _value(zero, rng):
    if isinstance(zero, str):
        return "".join(rng.choice(list("abcö/"), rng.randint(0, 6)))
    return bool(rng.randint(2)) if isinstance(zero, bool) else type(zero)(rng.randint(0, 100))


def _values(empty, kind, length, rng):
    if isinstance(empty, np.ndarray):
        return rng.randint(0, 2, length).astype(empty.dtype)
    if kind[0] == Nodetype.NAME:
        return [_fill(blank_message(ros1_types(), kind[1]), kind[1], rng) for _ in range(length)]
    return [_value("", rng) for _ in range(length)]


@pytest.mark.parametrize("name", TYPES)
@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_bytes_are_those_of_rosbags(name, seed):
    message = _fill(blank_message(ros1_types(), name), name, np.random.RandomState(seed))
    assert serializer(ros1_types(), name)(message) == bytes(ros1_types().serialize_ros1(message, name))


def test_numbers_of_the_other_byte_order_are_swapped():
    message = blank_message(ros1_types(), "sensor_msgs/msg/LaserScan")
    message.ranges = np.array([1.0, 2.5], dtype=">f4")
    swapped = serializer(ros1_types(), "sensor_msgs/msg/LaserScan")(message)
    message.ranges = message.ranges.astype("<f4")
    assert swapped == serializer(ros1_types(), "sensor_msgs/msg/LaserScan")(message)


def test_a_list_of_the_wrong_length_is_refused():
    message = blank_message(ros1_types(), "nav_msgs/msg/Odometry")
    message.pose.covariance = np.zeros(35)
    with pytest.raises(MessageBytesError, match=r"pose\.covariance: 35 values, must be 36"):
        serializer(ros1_types(), "nav_msgs/msg/Odometry")(message)


def test_blank_messages_share_nothing():
    first, second = (blank_message(ros1_types(), "nav_msgs/msg/Odometry") for _ in range(2))
    first.header.stamp.sec, first.pose.covariance[0] = 1, 1.0
    assert second.header.stamp.sec == 0
    assert second.pose.covariance[0] == 0.0
