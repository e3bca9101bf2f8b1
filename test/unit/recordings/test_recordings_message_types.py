"""Messages of zeros."""

import pytest

from recordings.bags.message_types import BEAM_TYPE, maker, ros1_types

TYPES = [
    BEAM_TYPE, "tf2_msgs/msg/TFMessage", "nav_msgs/msg/Odometry", "sensor_msgs/msg/JointState", "std_msgs/msg/Empty",
    "std_msgs/msg/Bool", "visualization_msgs/msg/Marker", "std_msgs/msg/String", "sensor_msgs/msg/PointCloud2",
    "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/CameraInfo", "diagnostic_msgs/msg/DiagnosticArray",
]  # fmt: skip


@pytest.mark.parametrize("name", TYPES)
def test_a_blank_message_is_written_as_zeros(name):
    written = bytes(ros1_types().serialize_ros1(maker(ros1_types(), name)(), name))
    assert written == bytes(len(written))


def test_blank_messages_share_nothing():
    first, second = (maker(ros1_types(), "nav_msgs/msg/Odometry")() for _ in range(2))
    first.header.stamp.sec, first.pose.covariance[0] = 1, 1.0
    assert second.header.stamp.sec == 0
    assert second.pose.covariance[0] == 0.0
