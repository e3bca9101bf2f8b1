#!/usr/bin/env python3
import unittest

import rospy
import rostest
from driver_listener import Listener, beams
from sensor_msgs.msg import PointCloud2

_ONE_TURN = 40.0


class TestEmulatedGraph(unittest.TestCase):
    def test_a_turn_of_the_head_becomes_a_map(self):
        maps = Listener("MLSM/cloud", PointCloud2)
        raw = beams()
        cloud = maps.wait_for_more(1, _ONE_TURN)[0]
        assert cloud.header.frame_id == "map"
        assert cloud.width > 100
        assert len(raw.received) >= rospy.get_param("~least_beams")


if __name__ == "__main__":
    rospy.init_node("driver_emulated")
    rostest.rosrun("underwater_map_construction", "driver_emulated", TestEmulatedGraph)
