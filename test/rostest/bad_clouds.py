#!/usr/bin/env python3
"""No cloud can end a stage: what cannot be used is counted, and the next cloud passes."""

import unittest

import numpy as np
from graph import Diagnostics, Inbox, rows, run, wait_for_links
from messages import publisher, still_cloud
from sensor_msgs.msg import PointCloud2

from underwater_map_construction.msg import StampedIntensityCloud

STAGES = {"thresholder": "/sonar/scan/sonarCloud", "outlier_remover": "/sonar/scan/thresholded",
          "mlsm_core": "/sonar/scan/cleaned"}  # fmt: skip
LISTENERS = {"outlier_remover": 2, "mlsm_core": 2}
"""Nodes that take a stage's input, where a detector takes it too."""


def wall(points: int = 400) -> np.ndarray:
    """Return points (n, 4) of a wall of strong echoes among weak ones."""
    along = np.linspace(0.0, 20.0, points, dtype=np.float32)
    strengths = np.where(np.arange(points) % 2, 120, 5).astype(np.float32)
    return np.column_stack([along, np.full(points, 3.0, np.float32), np.zeros(points, np.float32), strengths])


def dense(cloud: StampedIntensityCloud) -> StampedIntensityCloud:
    """Return the cloud saying that all its points are finite, whatever they are."""
    cloud.cloud.is_dense = True
    return cloud


class BadClouds(unittest.TestCase):
    """Sends to each stage on its own input."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.diagnostics = Diagnostics()
        cls.map = Inbox("/MLSM/cloud", PointCloud2)
        inputs = {**STAGES, "matching": "/sonar/scan/echoes"}
        cls.inputs = {
            stage: publisher(topic, StampedIntensityCloud, LISTENERS.get(stage, 1)) for stage, topic in inputs.items()
        }
        wait_for_links("/sonar/scan/thresholded", 1)
        wait_for_links("/sonar/scan/cleaned", 1)

    def send_to_all(self, cloud: StampedIntensityCloud) -> None:
        """Publish on every stage's input."""
        for stage in STAGES:
            self.inputs[stage].publish(cloud)

    def expect_for_all(self, counter: str, number: int) -> None:
        """Wait for a counter of every stage."""
        for stage in STAGES:
            self.diagnostics.wait_for(stage, counter, number)

    def test_1_stamps_that_do_not_match_the_points(self) -> None:
        cloud = still_cloud(wall())
        cloud.timeStamps = cloud.timeStamps[:-3]
        self.send_to_all(cloud)
        self.expect_for_all("clouds refused", 1)

    def test_3_points_and_stamps_that_are_not_finite_are_left_out(self) -> None:
        points = wall()
        points[7, 0] = np.nan
        points[8, 2] = np.inf
        self.send_to_all(dense(still_cloud(points)))
        self.expect_for_all("points that are not finite", 2)
        cloud = still_cloud(wall())
        cloud.timeStamps = np.array(cloud.timeStamps)
        cloud.timeStamps[5] = np.nan
        self.send_to_all(cloud)
        self.expect_for_all("points that are not finite", 3)

    def test_4_an_empty_cloud_passes(self) -> None:
        self.send_to_all(still_cloud(np.zeros((0, 4), np.float32)))
        self.diagnostics.wait_for("mlsm_core", "clouds in", 4)

    def test_5_a_cloud_far_outside_is_left_out_of_the_map(self) -> None:
        """1000 km away is a broken transform, not a wall."""
        self.inputs["mlsm_core"].publish(still_cloud(wall() + np.float32([1e6, 0, 0, 0])))
        self.diagnostics.wait_for("mlsm_core", "points outside the map", 400)

    def test_5_echoes_at_extreme_coordinates_are_left_out_of_the_match(self) -> None:
        """What no sonar can have heard is counted, and the rest of the scan is used."""
        points = wall()
        points[:3, 0] = 1e30, -1e6, 3e38
        self.inputs["matching"].publish(still_cloud(points))
        self.diagnostics.wait_for("mlsm_core", "echoes outside the map", 3)

    def test_6_a_cloud_in_another_frame_is_refused_by_the_map(self) -> None:
        """The map cannot know where the sonar was."""
        self.inputs["mlsm_core"].publish(still_cloud(wall(), frame="sonar"))
        self.diagnostics.wait_for("mlsm_core", "clouds refused", 2)

    def test_7_a_good_cloud_still_goes_all_the_way(self) -> None:
        self.map.wait_for_link()
        self.inputs["thresholder"].publish(still_cloud(wall() + np.float32([100, 0, 0, 0])))
        self.map.wait_for(lambda cloud: np.any(rows(cloud)[:, 0] > 99.0))

    def test_8_ten_scans_in_a_row_that_lose_every_point_are_noticed(self) -> None:
        """Otsu times 1.4 lies above the strongest echo here."""
        points = wall()
        points[:, 3] = np.where(np.arange(len(points)) % 2, 100, 101)
        for _ in range(10):
            self.inputs["thresholder"].publish(still_cloud(points))
        self.diagnostics.wait_for("thresholder", "scans in a row lost all points", 10)


if __name__ == "__main__":
    run(BadClouds)
