#!/usr/bin/env python3
"""Beams of other packages' types, published on sonar/raw, become scans; what is no beam is counted."""

import time
import unittest
from typing import Any

import numpy as np
import rospy
from dynamic_reconfigure.client import Client
from foreign_messages import message_classes, sane_message
from graph import Diagnostics, Inbox, end_publishing, publisher, rows, run
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import LaserScan, PointCloud2
from std_msgs.msg import String

STEPS = 200
RAYS = 400
WALL = 12.0
ECHO, MICRON = "ping360_sonar/SonarEcho", "micron_driver_ros/ScanLine"


class ForeignBeams(unittest.TestCase):
    """One node; its sonar is known to no tf, and mounted by parameters."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.published = 0
        cls.diagnostics, cls.log = Diagnostics(), Inbox("/rosout", Log).linked()
        cls.turns = Inbox("/sonar/scan/turn", PointCloud2).linked()
        cls.scans = Inbox("/sonar/scan/sonarCloud/cloud", PointCloud2).linked()

    def publish(self, kind: type, messages: Any) -> None:
        """Publish messages of one class on sonar/raw, and give the topic back for another when all have arrived."""
        beams = publisher("/sonar/raw", kind)
        for message in messages:
            beams.publish(message)
            type(self).published += 1
            time.sleep(0.004)
        self.diagnostics.wait_for("sonar_to_cloud", "messages in", self.published)
        end_publishing(beams)

    def wait_for_a_turn(self, kind: str) -> None:
        """Publish three turns of a head in front of a round wall, and see that one has come through as the wall."""
        before = len(self.turns.messages)
        self.publish(message_classes(kind)[kind], (sane_message(kind, step) for step in range(3 * STEPS + 10)))
        cloud = rows(self.turns.wait_for_number(before + 1)[-1])
        wall = np.linalg.norm(cloud[cloud[:, 3] == 120][:, :2], axis=1)
        self.assertGreater(wall.size, STEPS)
        np.testing.assert_allclose(wall, WALL, atol=1.0)

    def wait_for_log(self, text: str) -> None:
        """Wait until the node has logged a line that contains `text`."""
        self.log.wait_for(lambda _: any(text in entry.msg for entry in self.log.messages))

    def test_1_a_ping_360_that_sends_gradians(self) -> None:
        """Its frame is mounted by the parameters, and the unit of its angles is told by their values."""
        self.wait_for_a_turn(ECHO)
        self.wait_for_log("gradians, told by their values")
        self.wait_for_log("it is mounted in odom at 1 2 3 m")

    def test_2_a_mount_by_parameters_places_the_scans(self) -> None:
        cloud = rows(self.scans.wait_for())
        wall = cloud[cloud[:, 3] == 120]
        np.testing.assert_allclose(wall[:, :3].mean(axis=0), [1.0, 2.0, 3.0], atol=0.3)

    def test_3_a_micron_on_the_same_topic(self) -> None:
        """The type is that of each connection."""
        self.wait_for_a_turn(MICRON)

    def test_4_a_laser_scan_is_taken_with_a_warning_that_names_a_better_topic(self) -> None:
        kind = message_classes(ECHO)[ECHO]
        other = rospy.Publisher("/ping360/data", kind, queue_size=1)
        scan = LaserScan(angle_min=-3.14, angle_increment=6.28 / RAYS, range_max=50.0, ranges=[WALL] * RAYS)
        scan.header.frame_id, scan.header.stamp = "sonar", rospy.Time.now()
        before = self.diagnostics.known("sonar_to_cloud", "beams placed")
        self.publish(LaserScan, [scan])
        self.diagnostics.wait_for("sonar_to_cloud", "beams placed", before + RAYS)
        self.wait_for_log("/ping360/data (ping360_sonar/SonarEcho)")
        other.unregister()

    def test_5_what_is_no_beam_is_counted(self) -> None:
        self.publish(String, [String("hello")] * 3)
        self.diagnostics.wait_for("sonar_to_cloud", "messages of unknown types", 3)
        self.wait_for_a_turn(MICRON)
        self.assertNotIn("internal errors", self.diagnostics.values("sonar_to_cloud"))

    def test_6_a_sonar_that_is_turned_against_tf_is_put_right_while_it_runs(self) -> None:
        client = Client("sonar_to_cloud", timeout=10.0)
        before = self.heard_at()
        self.assertEqual(client.update_configuration({"sonar_turned": 0.5})["sonar_turned"], 0.5)
        self.assertAlmostEqual((self.heard_at() - before + np.pi) % (2.0 * np.pi) - np.pi, 0.5, places=2)
        self.wait_for_log("mlsm_core to begin it anew")

    def heard_at(self) -> float:
        """Publish a beam, and return where it hears the wall: rad, from the sonar, in odom."""
        beams = Inbox("/sonar/beam", PointCloud2).linked()
        self.publish(message_classes(MICRON)[MICRON], [sane_message(MICRON, 20)])
        cloud = rows(beams.wait_for())
        ahead, left = (cloud[cloud[:, 3] == 120][:, :2] - [1.0, 2.0]).mean(axis=0)
        return float(np.arctan2(left, ahead))


if __name__ == "__main__":
    run(ForeignBeams)
