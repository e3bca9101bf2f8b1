#!/usr/bin/env python3
"""Of an emulated head in a basin a turn becomes a map and walls, in the frames that a launch file names."""

import unittest

import rospy
from graph import Inbox, run
from sensor_msgs.msg import PointCloud2

from underwater_map_construction.msg import Walls


class Vehicle(unittest.TestCase):
    """Listens to what a topside computer would."""

    def test_a_turn_of_the_head_becomes_map_and_walls(self) -> None:
        blocks, walls = Inbox("/MLSM/cloud", PointCloud2), Inbox("/sonar/scan/line/coefficients", Walls)
        # The first turn may have begun before the head was placed.
        found = walls.wait_for(lambda message: len(message.walls) >= rospy.get_param("~walls"))
        self.assertEqual(found.header.frame_id, rospy.get_param("~odom_frame"))
        self.assertEqual(blocks.wait_for().header.frame_id, rospy.get_param("~map_frame"))


if __name__ == "__main__":
    run(Vehicle)
