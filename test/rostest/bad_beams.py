#!/usr/bin/env python3
"""No beam can end the graph: what cannot be used is counted, and the next scan arrives in the map."""

import math
import sys
import unittest

import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from graph import Diagnostics, Inbox, run, wait_for_links, wait_for_publisher_links
from sensor_msgs.msg import PointCloud2

from underwater_map_construction.msg import SonarScanLine

SCAN = 120


class BadBeams(unittest.TestCase):
    """One graph for all tests; stamps grow from test to test."""

    @classmethod
    def setUpClass(cls) -> None:
        """Publish the frames once and connect."""
        cls.diagnostics = Diagnostics()
        cls.scans = Inbox("/sonar/scan/cleaned/cloud", PointCloud2)
        cls.beams = rospy.Publisher("/sonar/raw", SonarScanLine, queue_size=1000)
        cls.transforms = tf2_ros.StaticTransformBroadcaster()
        mount = TransformStamped(child_frame_id="sonar")
        mount.header.frame_id = "odom"
        mount.header.stamp = rospy.Time(1)
        mount.transform.rotation.w = 1.0
        cls.transforms.sendTransform(mount)
        wait_for_publisher_links(cls.beams, 1)
        # The beams wait a few seconds for it and no longer.
        wait_for_links("/tf_static")
        if "many" in sys.argv:
            wait_for_links("/sonar/scan/sonarCloud")
            wait_for_links("/sonar/scan/thresholded")
        cls.scans.wait_for_link()
        cls.time = rospy.get_time()

    def send(self, frame: str = "sonar", **fields: object) -> None:
        """Publish one beam 0.1 s after the one before."""
        type(self).time += 0.1
        message = SonarScanLine(intensities=bytes([100] * 50), maxrange_meters=50.0, range_resolution=1.0)
        message.header.frame_id = frame
        message.header.stamp = rospy.Time.from_sec(self.time)
        for name, value in fields.items():
            setattr(message, name, value)
        self.beams.publish(message)

    def send_scan(self) -> None:
        """Publish a full turn with an echo in the middle of each beam."""
        for step in range(SCAN):
            strengths = bytes([3] * 20 + [120] * 3 + [3] * 27)
            self.send(angle=2.0 * math.pi * step / SCAN, intensities=strengths)

    def expect_a_scan(self) -> None:
        """Send full turns until the chain delivers a new cloud with the echoes in it."""
        start = rospy.Time.from_sec(self.time)
        self.send_scan()
        self.send_scan()
        self.scans.wait_for(
            lambda cloud: start < cloud.header.stamp <= rospy.Time.from_sec(self.time) and cloud.width > 100
        )

    def test_1_a_good_scan_passes(self) -> None:
        """The graph works before anything bad is sent."""
        self.expect_a_scan()

    def test_2_beams_that_cannot_be_placed_are_refused_one_by_one(self) -> None:
        """Empty, too long, without range, without direction, without frame."""
        self.send(intensities=b"")
        self.send(intensities=bytes(10000))
        self.send(range_resolution=0.0)
        self.send(range_resolution=-1.0)
        self.send(maxrange_meters=0.0)
        self.send(maxrange_meters=-50.0)
        self.send(range_resolution=float("nan"))
        self.send(angle=float("nan"))
        self.send(angle=float("inf"))
        self.send(frame="")
        self.diagnostics.wait_for("sonar_to_cloud", "beams refused", 10)
        self.expect_a_scan()

    def test_3_beams_whose_transform_never_comes_are_dropped(self) -> None:
        """After 5 s all but 120 are counted, and other frames go on."""
        for _ in range(150):
            self.send(frame="nowhere")
        self.diagnostics.wait_for("sonar_to_cloud", "beams without transform", 30)
        self.expect_a_scan()

    def test_4_a_beam_older_than_its_predecessor_is_left_out(self) -> None:
        """A little late is out of order, not a jump of time."""
        self.send()
        type(self).time -= 0.5
        self.send()
        type(self).time += 0.5
        self.diagnostics.wait_for("sonar_to_cloud", "beams out of order", 1)
        self.expect_a_scan()

    def test_5_time_that_jumps_back_starts_a_new_scan(self) -> None:
        """As when a bag loops."""
        type(self).time -= 100.0
        self.send()
        self.diagnostics.wait_for("sonar_to_cloud", "jumps back in time", 1)
        self.expect_a_scan()


if __name__ == "__main__":
    run(BadBeams)
