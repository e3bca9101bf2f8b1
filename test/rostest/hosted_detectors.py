#!/usr/bin/env python3
"""The detectors in the process of the other stages find what they find as nodes, on the same topics."""

import unittest

import rosgraph
from graph import TEST_DATA, Diagnostics, Inbox, run, wait_for_subscribers
from playback import play, steps_every

from sonar_processing.ros.conversions import cloud_from_message
from sonar_processing.shapes.lines import LineDetector, LineDetectorParameters
from underwater_map_construction.msg import Circles, StampedIntensityCloud, Walls

# Turns of the head in the bag, which ends in the middle of one.
SCANS = 10
N_WALLS = 2
BAG = TEST_DATA / "basin.bag"
SECONDS = 4.0  # between waits for a slow node


class HostedDetectors(unittest.TestCase):
    """Plays the bag once for all tests."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.diagnostics = Diagnostics()
        cls.clouds = Inbox("/sonar/scan/cleaned", StampedIntensityCloud)
        cls.walls = Inbox("/sonar/scan/line/coefficients", Walls)
        cls.circles = Inbox("/sonar/scan/circle/coefficients", Circles)
        inboxes = (cls.clouds, cls.walls, cls.circles)
        for inbox in inboxes:
            inbox.wait_for_link()
        wait_for_subscribers("/sonar/raw", 1)
        play(BAG, 15.0, steps_every(SECONDS, BAG, cls.wait_for_shapes))
        for inbox in inboxes:
            inbox.wait_for_number(SCANS)

    @classmethod
    def wait_for_shapes(cls) -> None:
        """Wait until every cloud so far has been searched."""
        for shapes in (cls.walls, cls.circles):
            shapes.wait_for_number(len(cls.clouds.messages))

    def test_the_walls_are_those_of_the_cleaned_clouds(self) -> None:
        """With the parameters of the detector's own namespace."""
        detector = LineDetector(LineDetectorParameters(n_walls=N_WALLS))
        expected = {cloud.header.stamp: len(detector(cloud_from_message(cloud))) for cloud in self.clouds.messages}
        found = {walls.header.stamp: len(walls.walls) for walls in self.walls.messages}
        self.assertEqual(found, expected)
        self.assertEqual(max(found.values()), N_WALLS)

    def test_every_scan_is_searched_for_circles(self) -> None:
        stamps = [cloud.header.stamp for cloud in self.clouds.messages]
        self.assertEqual([circles.header.stamp for circles in self.circles.messages], stamps)

    def test_the_detectors_take_no_process_and_report_on_their_own(self) -> None:
        nodes = {node for _, users in rosgraph.Master("/graph_test").getSystemState()[0] for node in users}
        for name in ("line_detector", "circle_detector"):
            self.assertNotIn(f"/{name}", nodes)
            self.diagnostics.wait_for(name, "clouds in", SCANS)


if __name__ == "__main__":
    run(HostedDetectors)
