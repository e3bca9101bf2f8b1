"""Messages of zeros, and many messages at once to the bytes that rosbags writes of each alone."""

import numpy as np
import pytest
from rosbags.interfaces import Nodetype

from recordings.bags.message_types import BEAM_TYPE, blank_message, message_rows, ros1_types

NUMBER = 3
TYPES = [
    BEAM_TYPE, "tf2_msgs/msg/TFMessage", "nav_msgs/msg/Odometry", "sensor_msgs/msg/JointState", "std_msgs/msg/Empty",
    "std_msgs/msg/Bool", "visualization_msgs/msg/Marker", "std_msgs/msg/String", "sensor_msgs/msg/PointCloud2",
    "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/CameraInfo", "diagnostic_msgs/msg/DiagnosticArray",
]  # fmt: skip


def _filled(name, rng, several):
    """Return a message with `several` values in every field, and the NUMBER messages that it stands for."""
    together = blank_message(ros1_types(), name)
    alone = [blank_message(ros1_types(), name) for _ in range(NUMBER)]
    for field, (node, detail) in ros1_types().FIELDDEFS[name][1]:
        value, values = _values(getattr(together, field), node, detail, rng, several)
        setattr(together, field, value)
        for message, own in zip(alone, values):
            setattr(message, field, own)
    return together, alone


def _values(blank, node, detail, rng, several):
    if node == Nodetype.NAME:
        return _filled(detail, rng, several)
    if isinstance(blank, str):
        return "odom", ["odom"] * NUMBER
    if node == Nodetype.BASE:
        numbers = rng.randint(0, 2, NUMBER if several else 1).astype(type(blank))
        return (numbers, numbers.tolist()) if several else (numbers[0], [numbers[0]] * NUMBER)
    length = detail[1] if node == Nodetype.ARRAY else 2
    if isinstance(blank, np.ndarray):
        arrays = rng.randint(0, 100, (NUMBER, length)).astype(blank.dtype)
        return (arrays, list(arrays)) if several else (arrays[0], [arrays[0]] * NUMBER)
    if detail[0][0] == Nodetype.NAME:
        parts = [_filled(detail[0][1], rng, several) for _ in range(length)]
        return [together for together, _ in parts], [list(own) for own in zip(*[alone for _, alone in parts])]
    return ["a", "bc"], [["a", "bc"]] * NUMBER


@pytest.mark.parametrize("several", [True, False])
@pytest.mark.parametrize("name", TYPES)
def test_each_row_is_the_message_alone(name, several):
    together, alone = _filled(name, np.random.RandomState(0), several)
    rows = message_rows(ros1_types(), name, together, NUMBER)
    assert [row.tobytes() for row in rows] == [bytes(ros1_types().serialize_ros1(one, name)) for one in alone]


def test_blank_messages_share_nothing():
    first, second = (blank_message(ros1_types(), "nav_msgs/msg/Odometry") for _ in range(2))
    first.header.stamp.sec, first.pose.covariance[0] = 1, 1.0
    assert second.header.stamp.sec == 0
    assert second.pose.covariance[0] == 0.0
