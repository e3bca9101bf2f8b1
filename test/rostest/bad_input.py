#!/usr/bin/env python3
"""No beam and no cloud can end a stage: what cannot be used is counted, and the next scan arrives in the map."""

import math
import unittest

import numpy as np
import rospy
import tf2_ros
from graph import Diagnostics, Inbox, nodes_of, publisher, rows, run, wait_for_links
from messages import beam, still_cloud, transform, turn
from sensor_msgs.msg import PointCloud2

from underwater_map_construction.msg import SonarScanLine, StampedIntensityCloud

SCAN = 120
STAGES = {
    "thresholder": ("/sonar/scan/sonarCloud", 1),
    "outlier_remover": ("/sonar/scan/thresholded", 2),
    "mlsm_core": ("/sonar/scan/cleaned", 2),
}
"""Stage to its input, and how many nodes take that."""


def wall(points: int = 400) -> np.ndarray:
    """Return points (n, 4) of a wall of strong echoes among weak ones."""
    along = np.linspace(0.0, 20.0, points, dtype=np.float32)
    strengths = np.where(np.arange(points) % 2, 120, 5).astype(np.float32)
    return np.column_stack([along, np.full(points, 3.0, np.float32), np.zeros(points, np.float32), strengths])


class BadInput(unittest.TestCase):
    """One graph for all tests; stamps of beams grow from test to test."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.diagnostics, cls.map = Diagnostics(), Inbox("/MLSM/cloud", PointCloud2).linked()
        cls.scans = Inbox("/sonar/scan/cleaned/cloud", PointCloud2).linked()
        cls.transforms = tf2_ros.StaticTransformBroadcaster()
        cls.transforms.sendTransform(transform("odom", "sonar", 1.0))
        cls.beams = publisher("/sonar/raw", SonarScanLine)
        cls.clouds = {stage: publisher(topic, StampedIntensityCloud, n) for stage, (topic, n) in STAGES.items()}
        cls.echoes = publisher("/sonar/scan/echoes", StampedIntensityCloud)
        # The beams wait a few seconds for /tf_static and no longer.
        for topic, listeners in (("/tf_static", 1), *STAGES.values()):
            wait_for_links(topic, listeners)
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

    def expect_of_all(self, counter: str, number: int, cloud: StampedIntensityCloud) -> None:
        """Publish on every stage's input, and wait for a counter of every stage."""
        for stage in STAGES:
            self.clouds[stage].publish(cloud)
        for stage in STAGES:
            self.diagnostics.wait_for(stage, counter, number)

    def test_beams_0_from_before_tf_are_counted_without_a_warning(self) -> None:
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

    def test_beams_1_that_cannot_be_placed_are_refused_one_by_one(self) -> None:
        bad = {"intensities": b"", "range_resolution": -1.0, "maxrange_meters": 0.0, "angle": math.nan, "frame": ""}
        for name, value in bad.items():
            self.send(**{name: value})
        self.diagnostics.wait_for("sonar_to_cloud", "beams refused", len(bad))
        self.expect_a_scan()

    def test_beams_2_whose_transform_never_comes_are_dropped(self) -> None:
        """After 5 s all but 120 are counted, and other frames go on."""
        for _ in range(150):
            self.send(frame="nowhere")
        self.diagnostics.wait_for("sonar_to_cloud", "beams without transform", 30)
        self.expect_a_scan()

    def test_beams_3_older_than_their_predecessor_are_left_out(self) -> None:
        """A little late is out of order, not a jump of time."""
        self.send()
        type(self).time -= 0.5
        self.send()
        type(self).time += 0.5
        self.diagnostics.wait_for("sonar_to_cloud", "beams out of order", 1)
        self.expect_a_scan()

    def test_beams_4_of_a_time_that_jumps_back_start_a_new_scan(self) -> None:
        type(self).time -= 100.0
        self.send()
        self.diagnostics.wait_for("sonar_to_cloud", "jumps back in time", 1)
        self.expect_a_scan()

    def test_clouds_0_with_stamps_that_do_not_match_the_points_are_refused(self) -> None:
        cloud = still_cloud(wall())
        cloud.timeStamps = cloud.timeStamps[:-3]
        self.expect_of_all("clouds refused", 1, cloud)

    def test_clouds_1_lose_points_that_are_not_finite_whatever_they_say_of_themselves(self) -> None:
        points = wall()
        points[7, 0], points[8, 2] = np.nan, np.inf
        cloud = still_cloud(points)
        cloud.cloud.is_dense = True
        self.expect_of_all("points that are not finite", 2, cloud)

    def test_clouds_2_far_outside_are_left_out_of_the_map(self) -> None:
        """1000 km away is a broken transform, not a wall."""
        self.clouds["mlsm_core"].publish(still_cloud(wall() + np.float32([1e6, 0, 0, 0])))
        self.diagnostics.wait_for("mlsm_core", "points outside the map", 400)

    def test_clouds_3_of_echoes_at_extreme_coordinates_are_matched_without_them(self) -> None:
        points = wall()
        points[:3, 0] = 1e30, -1e6, 3e38
        self.echoes.publish(still_cloud(points))
        self.diagnostics.wait_for("mlsm_core", "echoes outside the map", 3)

    def test_clouds_4_in_another_frame_are_refused_by_the_map(self) -> None:
        """The map cannot know where the sonar was."""
        self.clouds["mlsm_core"].publish(still_cloud(wall(), frame="sonar"))
        self.diagnostics.wait_for("mlsm_core", "clouds refused", 2)

    def test_clouds_5_that_are_good_still_go_all_the_way(self) -> None:
        self.clouds["thresholder"].publish(still_cloud(wall() + np.float32([100, 0, 0, 0])))
        self.map.wait_for(lambda cloud: np.any(rows(cloud)[:, 0] > 99.0))

    def test_clouds_6_that_lose_every_point_ten_times_in_a_row_are_noticed(self) -> None:
        """Otsu times 1.4 lies above the strongest echo here."""
        points = wall()
        points[:, 3] = np.where(np.arange(len(points)) % 2, 100, 101)
        for _ in range(10):
            self.clouds["thresholder"].publish(still_cloud(points))
        self.diagnostics.wait_for("thresholder", "scans in a row lost all points", 10)


if __name__ == "__main__":
    run(BadInput)
