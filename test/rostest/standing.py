#!/usr/bin/env python3
"""A vehicle that stands still, with a static odometry, keeps its place from scan to scan."""

import subprocess
import unittest
from typing import Optional

import numpy as np
import rospkg
import rospy
import yaml
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph import PACKAGE_ROOT, Diagnostics, Inbox, publisher, run, skip, wait_for_links
from messages import still_echoes
from nav_msgs.msg import Odometry
from rep_rules import check_poses, check_tree
from tf2_msgs.msg import TFMessage

from underwater_map_construction.msg import PositionStatus, StampedIntensityCloud

SCANS = 8
FILTER = "robot_localization"
SECONDS = 16.0
WALLS = [((-12, 12), (14, 12)), ((14, 12), (14, -10)), ((-10, -8), (-4, -10)), ((3, 6), (5, 8))]


class Standing(unittest.TestCase):
    """Eight scans of one place; the vehicle was moved by 0.5 m after the first, which the odometry does not tell."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.fixes, cls.transforms = Inbox("/MLSM/odometry", Odometry).linked(), Inbox("/tf", TFMessage)
        cls.poses = Inbox("/MLSM/pose", PoseWithCovarianceStamped).linked()
        cls.filtered = Inbox("/odometry/filtered", Odometry)
        cls.filter = start_filter()
        cls.diagnostics = Diagnostics()
        cls.publisher = publisher("/sonar/scan/echoes", StampedIntensityCloud)
        wait_for_links("/tf_static")
        cls.transforms.wait_for()
        start = rospy.Time.now().to_sec()
        for turn in range(SCANS):
            cls.publisher.publish(scan(start + turn * SECONDS, 0.5 * (turn > 0)))
        cls.diagnostics.wait_for("mlsm_core", "scans in", SCANS)

    def test_every_scan_after_the_first_gives_a_fix(self) -> None:
        """They lie 0.5 m from where the first was taken."""
        places = [fix.pose.pose.position.x for fix in self.fixes.wait_for_number(SCANS - 1)]
        np.testing.assert_allclose(places, 0.5, atol=0.1)

    def test_map_to_odom_comes_to_the_fix(self) -> None:
        self.transforms.wait_for(lambda message: abs(message.transforms[0].transform.translation.x - 0.5) < 0.1)

    def test_it_is_told_how_well_the_position_is_known(self) -> None:
        good = Inbox("/MLSM/status", PositionStatus).wait_for(lambda status: status.state == PositionStatus.GOOD)
        self.assertEqual(good.header.frame_id, "map")
        self.assertTrue(0.0 < good.covariance[0] + good.covariance[4] < 25.0, good)

    def test_fixes_and_transforms_obey_rep_103_and_105(self) -> None:
        fixes, poses = self.fixes.wait_for_number(SCANS - 1), self.poses.wait_for_number(SCANS - 1)
        check_poses(fixes, "map", "base_link")
        check_poses(poses, "map")
        check_tree([one for message in self.transforms.messages for one in message.transforms])

    def test_robot_localization_follows_the_fixes(self) -> None:
        if self.filter is None:
            skip("robot_localization", f"{FILTER} is not installed: yaml/robot_localization.yaml was not played")
        self.addCleanup(self.filter.terminate)
        self.filtered.wait_for(lambda message: abs(message.pose.pose.position.x - 0.5) < 0.1)

    def test_time_did_not_jump(self) -> None:
        """A transform that holds for all time has the stamp 0."""
        self.assertNotIn("jumps in time", self.diagnostics.values("mlsm_core"))


def start_filter() -> Optional["subprocess.Popen[bytes]"]:
    """Start robot_localization with the example's parameters, where it is installed."""
    if FILTER not in rospkg.RosPack().list():
        return None
    rospy.set_param("/ekf", yaml.safe_load((PACKAGE_ROOT / "yaml/robot_localization.yaml").read_text()))
    return subprocess.Popen(["rosrun", FILTER, "ekf_localization_node", "__name:=ekf"])


def scan(start: float, moved: float) -> StampedIntensityCloud:
    """Return the echoes of all walls as heard from x = `moved` [m], in odom, from `start` [s] on."""
    points = np.vstack([np.linspace(*ends, 40) for ends in np.array(WALLS, dtype=float)])
    points = points[np.argsort(np.arctan2(points[:, 1], points[:, 0]))] - [moved, 0.0]
    return still_echoes(points, start + np.linspace(0.0, SECONDS, len(points)))


if __name__ == "__main__":
    run(Standing)
