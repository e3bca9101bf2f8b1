#!/usr/bin/env python3
"""Detectors of walls and circles: what they publish, and that no cloud can end them."""

import math
import unittest

import numpy as np
import rospy
from graph import Diagnostics, Inbox, publisher, run, wait_for_links
from messages import still_cloud
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

from underwater_map_construction.msg import Circles, StampedIntensityCloud, Walls

DETECTORS = ("line_detector", "circle_detector")
BUOY = np.array([4.0, -6.0])


def scan() -> np.ndarray:
    """Return points (n, 4): a wall at y = 8 from x = -10 to 10 and the near side of a buoy at (4, -6)."""
    along = np.linspace(-10.0, 10.0, 41)
    wall = np.column_stack([along, np.full(41, 8.0)])
    bearings = math.atan2(BUOY[1], BUOY[0]) + np.pi + np.linspace(-0.7, 0.7, 5)
    buoy = BUOY + 0.4 * np.column_stack([np.cos(bearings), np.sin(bearings)])
    xy = np.concatenate([wall, buoy])
    return np.column_stack([xy, np.full(len(xy), -2.0), np.full(len(xy), 100.0)]).astype(np.float32)


def message(points: np.ndarray, frame: str = "odom") -> StampedIntensityCloud:
    """Return the points as a message, each of a beam of its own."""
    return still_cloud(points, frame, round(rospy.get_time()) + 0.1 * np.arange(len(points)))


class Shapes(unittest.TestCase):
    """Sends clouds to both detectors."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.diagnostics = Diagnostics()
        cls.walls = Inbox("/sonar/scan/line/coefficients", Walls).linked()
        cls.circles = Inbox("/sonar/scan/circle/coefficients", Circles).linked()
        cls.wall_points = Inbox("/sonar/scan/line", PointCloud2).linked()
        cls.wall_markers = Inbox("/sonar/scan/line/markers", MarkerArray).linked()
        cls.clouds = publisher("clouds", StampedIntensityCloud, listeners=2)
        wait_for_links("/tf_static", 2)

    def expect_for_both(self, counter: str, number: int) -> None:
        """Wait for a counter of both detectors."""
        for name in DETECTORS:
            self.diagnostics.wait_for(name, counter, number)

    def test_1_an_empty_cloud_holds_no_shape(self) -> None:
        self.clouds.publish(message(np.zeros((0, 4), np.float32)))
        self.expect_for_both("clouds in", 1)
        self.assertEqual(self.walls.wait_for().walls, [])
        self.assertEqual(self.circles.wait_for().circles, [])

    def test_2_points_that_are_not_finite_in_a_cloud_that_says_that_it_has_none_are_counted(self) -> None:
        points = scan()
        points[3, 0] = np.nan
        cloud = message(points)
        cloud.cloud.is_dense = True
        self.clouds.publish(cloud)
        self.expect_for_both("points that are not finite", 1)

    def test_3_a_frame_that_tf_does_not_know_costs_circles_and_no_walls(self) -> None:
        """Walls need no sonar; whether a circle is seen from outside does."""
        self.clouds.publish(message(scan(), frame="moon"))
        self.expect_for_both("scans without sonar position", 1)
        (wall,) = self.walls.wait_for(lambda m: m.header.frame_id == "moon").walls
        self.assertTrue(math.isnan(wall.sonar_distance))

    def test_4_the_wall_is_where_it_is_and_as_long(self) -> None:
        self.clouds.publish(message(scan()))
        walls = self.walls.wait_for(lambda m: m.header.frame_id == "odom" and m.walls and m.walls[0].inliers == 41)
        (wall,) = walls.walls
        self.assertAlmostEqual(wall.orientation, math.pi / 2, places=3)
        self.assertAlmostEqual(wall.distance, 8.0, places=3)
        self.assertAlmostEqual(wall.sonar_distance, 8.0, places=3)
        self.assertAlmostEqual(abs(wall.end.x - wall.start.x), 20.0, places=3)
        self.assertAlmostEqual(wall.start.z, -2.0, places=3)
        self.wall_points.wait_for(lambda cloud: cloud.width == 41)
        markers = self.wall_markers.wait_for(lambda m: m.markers[0].header.stamp == walls.header.stamp).markers
        (line,) = [marker for marker in markers if marker.type == Marker.LINE_STRIP]
        self.assertEqual(line.points, [wall.start, wall.end])

    def test_5_the_buoy_is_where_it_is(self) -> None:
        circles = self.circles.wait_for(lambda m: m.header.frame_id == "odom" and len(m.circles) == 1)
        (circle,) = circles.circles
        self.assertLess(math.hypot(circle.center.x - BUOY[0], circle.center.y - BUOY[1]), 0.15)
        self.assertEqual(circle.inliers, 5)


if __name__ == "__main__":
    run(Shapes)
