"""The check of poses against REP-103, REP-105 and robot_localization notices each broken rule."""

import math

import numpy as np
import pytest
import rospy
import yaml
from messages import transform
from nav_msgs.msg import Odometry
from rep_rules import broken_rules, broken_tree

from node_support import topics
from node_support.files import package_folder


def _fix(seconds=1.0):
    message = Odometry(child_frame_id="base_link")
    message.header.frame_id, message.header.stamp = "map", rospy.Time.from_sec(seconds)
    message.pose.pose.orientation.w = 1.0
    message.pose.covariance = message.twist.covariance = np.diag([1.0, 1.0, 9.0, 9.0, 9.0, 0.1]).ravel().tolist()
    return message


def _with_covariance(**entries):
    matrix = np.diag([1.0, 1.0, 9.0, 9.0, 9.0, 0.1])
    for place, value in entries.items():
        matrix[int(place[1]), int(place[2])] = value
    message = _fix()
    message.pose.covariance = matrix.ravel().tolist()
    return message


def test_a_fix_as_mlsm_core_sends_it_breaks_no_rule():
    assert broken_rules([_fix(1.0), _fix(2.0)], "map", "base_link") == []


@pytest.mark.parametrize(
    ("message", "rule"),
    [
        (_with_covariance(_01=0.5), "not symmetric"),
        (_with_covariance(_00=0.0), "not positive"),
        (_with_covariance(_55=math.nan), "not finite"),
        (_with_covariance(_22=0.01, _55=9.0), "less known than z"),
        (_fix(0.0), "stamp 0"),
        (Odometry(), "quaternion of length 0"),
        (Odometry(), "frame ''"),
        (Odometry(), "child frame ''"),
    ],
)
def test_a_broken_rule_is_named(message, rule):
    assert any(rule in found for found in broken_rules([message], "map", "base_link"))


def test_stamps_must_increase():
    assert broken_rules([_fix(2.0), _fix(2.0)], "map") == ["stamps do not increase"]


def test_a_frame_has_one_parent_and_odom_is_level():
    tilted = transform("map", "odom")
    tilted.transform.rotation.x, tilted.transform.rotation.w = math.sin(0.1), math.cos(0.1)
    assert broken_tree([transform("map", "odom"), transform("odom", "base_link")]) == []
    assert broken_tree([transform("map", "base_link"), transform("odom", "base_link")]) == [
        "base_link has the parents ['map', 'odom']"
    ]
    assert broken_tree([tilted]) == ["odom is tilted in map, heading 0.00 rad"]


def test_the_example_for_robot_localization_takes_what_there_is_and_leaves_tf_to_mlsm_core():
    example = yaml.safe_load((package_folder() / "yaml/robot_localization.yaml").read_text())
    assert (example["odom0"], example["pose0"]) == (topics.ODOMETRY, topics.MATCHED_POSE)
    assert not example["publish_tf"]
    assert example["world_frame"] == example["map_frame"]
    used = {name: [axis for axis, uses in enumerate(example[f"{name}_config"]) if uses] for name in ("odom0", "pose0")}
    assert used == {"odom0": [6, 7, 11], "pose0": [0, 1, 5]}
    assert {len(example[f"{name}_config"]) for name in used} == {15}
