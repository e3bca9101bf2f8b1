"""What play_bag reads of a bag, and how it turns an odometry that counts z down."""

import numpy as np
import pytest
import rosbag
import rospy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from std_msgs.msg import Float64
from tf2_msgs.msg import TFMessage

from node_support.ros.node import StartError
from recordings.ros.play_bag import play_arguments, read_messages
from underwater_map_construction.msg import SonarScanLine


def _transform(parent, child):
    transform = TransformStamped(child_frame_id=child)
    transform.header.frame_id = parent
    shift, turn = transform.transform.translation, transform.transform.rotation
    shift.x, shift.y, shift.z = 1.0, 2.0, 3.0
    turn.x, turn.y, turn.z, turn.w = 0.1, 0.2, 0.3, np.sqrt(0.86)
    return transform


def _values(place):
    return [getattr(place, name) for name in ("x", "y", "z", "w") if hasattr(place, name)]


@pytest.fixture
def bag(tmp_path):
    """Write topics one after the other, as some recordings are stored."""
    path = tmp_path / "recorded.bag"
    odometry = Odometry()
    odometry.pose.pose.position.z = 5.0
    with rosbag.Bag(str(path), "w") as written:
        for seconds in (1.0, 3.0):
            written.write("depth", Float64(seconds), rospy.Time.from_sec(seconds))
        moved = TFMessage([_transform("odom", "base_link"), _transform("base_link", "sonar")])
        written.write("/tf", moved, rospy.Time.from_sec(2.0))
        written.write("odom", odometry, rospy.Time.from_sec(2.5))
    return path


def _read(*arguments):
    return read_messages(play_arguments([str(argument) for argument in arguments]))


def test_messages_come_in_the_order_of_their_times(bag):
    assert [one.time for one in _read(bag)] == [1.0, 2.0, 2.5, 3.0]


def test_only_the_chosen_topics_are_read(bag):
    assert {one.topic for one in _read(bag, "--topics", "depth", "/none")} == {"depth"}


def test_a_bag_whose_beams_are_not_played_says_which_topics_it_has(bag, caplog):
    _read(bag, "--topics", "/tf")
    assert caplog.messages == [
        f"{bag}: no topic that is played holds beams; the bag has /tf (tf2_msgs/TFMessage), depth (std_msgs/Float64), "
        "odom (nav_msgs/Odometry)"
    ]


def test_nothing_is_said_where_beams_are_played(tmp_path, caplog):
    with rosbag.Bag(str(tmp_path / "beams.bag"), "w") as written:
        written.write("/sonar/raw", SonarScanLine(), rospy.Time.from_sec(1.0))
    _read(tmp_path / "beams.bag")
    assert caplog.messages == []


def test_ned_turns_the_vehicle_in_odom_and_leaves_the_mount(bag):
    moved = next(one.message for one in _read(bag, "--ned") if one.topic == "/tf")
    vehicle, mount = (transform.transform for transform in moved.transforms)
    assert _values(vehicle.translation) == [1.0, -2.0, -3.0]
    assert _values(vehicle.rotation) == [0.1, -0.2, -0.3, np.sqrt(0.86)]
    assert _values(mount.translation) == [1.0, 2.0, 3.0]


def test_ned_turns_an_odometry_message(bag):
    odometry = next(one.message for one in _read(bag, "--ned") if one.topic == "odom")
    assert odometry.pose.pose.position.z == -5.0


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--topics", "/none"], "no message on /none"),
        (["--ned", "--topics", "depth"], "--ned turns the pose odom -> base_link"),
    ],
)
def test_a_bag_that_cannot_be_played_is_refused_in_one_line(bag, arguments, reason):
    with pytest.raises(StartError, match=reason):
        _read(bag, *arguments)


def test_a_file_that_is_no_bag_is_refused_in_one_line(tmp_path):
    path = tmp_path / "no.bag"
    path.write_text("no bag")
    with pytest.raises(StartError, match="not a bag, or damaged"):
        _read(path)


def test_a_relative_path_that_is_not_there_is_told_whole(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(StartError, match=f"^{tmp_path}/no.bag: No such file or directory; give the whole path"):
        _read("no.bag")
