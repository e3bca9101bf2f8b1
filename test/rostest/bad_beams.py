#!/usr/bin/env python3
"""No beam can end the graph: what cannot be used is counted, and the next scan arrives in the map."""

import math
import unittest

import rospy
import tf2_ros
from graph import Diagnostics, Inbox, nodes_of, run, wait_for_links
from messages import beam, publisher, transform, turn
from sensor_msgs.msg import PointCloud2

from underwater_map_construction.msg import SonarScanLine

SCAN = 120


class BadBeams(unittest.TestCase):
    """One graph for all tests; stamps grow from test to test."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.diagnostics = Diagnostics()
        cls.scans = Inbox("/sonar/scan/cleaned/cloud", PointCloud2)
        cls.transforms = tf2_ros.StaticTransformBroadcaster()
        cls.transforms.sendTransform(transform("odom", "sonar", 1.0))
        cls.beams = publisher("/sonar/raw", SonarScanLine)
        # The beams wait a few seconds for it and no longer.
        wait_for_links("/tf_static")
        wait_for_links("/sonar/scan/sonarCloud")
        wait_for_links("/sonar/scan/thresholded")
        cls.scans.wait_for_link()
        cls.time = rospy.get_time()

    def send(self, frame: str = "sonar", **fields: object) -> None:
        """Publish one beam 0.1 s after the one before."""
        type(self).time += 0.1
        message = beam(self.time, strengths=bytes([100] * 50), frame=frame)
        for name, value in fields.items():
            setattr(message, name, value)
        self.beams.publish(message)

    def expect_a_scan(self) -> None:
        """Send full turns until the chain delivers a new cloud with the echoes in it."""
        start = rospy.Time.from_sec(self.time)
        for message in 2 * turn(0.0, 0.0, SCAN):
            self.send(angle=message.angle, intensities=message.intensities)
        self.scans.wait_for(
            lambda cloud: start < cloud.header.stamp <= rospy.Time.from_sec(self.time) and cloud.width > 100
        )

    def test_0_beams_from_before_tf_are_counted_without_a_warning(self) -> None:
        broadcaster, early = tf2_ros.TransformBroadcaster(), 3
        wait_for_links("/tf", len(nodes_of("/tf")[1]))
        for _ in range(early):
            self.send(frame="late")
        for seconds in (0.05, 1.0):
            broadcaster.sendTransform(transform("odom", "late", self.time + seconds))
        self.send(frame="late")
        self.diagnostics.wait_for("sonar_to_cloud", "beams before tf", early)
        self.assertNotIn("beams without transform", self.diagnostics.values("sonar_to_cloud"))
        type(self).time += 1.0

    def test_1_a_good_scan_passes(self) -> None:
        self.expect_a_scan()

    def test_2_beams_that_cannot_be_placed_are_refused_one_by_one(self) -> None:
        bad = {
            "intensities": (b"", bytes(10000)),
            "range_resolution": (0.0, -1.0, math.nan),
            "maxrange_meters": (0.0, -50.0),
            "angle": (math.nan, math.inf),
            "frame": ("",),
        }
        for name, values in bad.items():
            for value in values:
                self.send(**{name: value})
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
        type(self).time -= 100.0
        self.send()
        self.diagnostics.wait_for("sonar_to_cloud", "jumps back in time", 1)
        self.expect_a_scan()


if __name__ == "__main__":
    run(BadBeams)
