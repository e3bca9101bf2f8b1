#!/usr/bin/env python3
import unittest

import rospy
from driver_listener import beams
from graph import Inbox, run
from sensor_msgs.msg import PointCloud2


class TestEmulatedGraph(unittest.TestCase):
    def test_a_turn_of_the_head_becomes_a_map(self):
        maps = Inbox("MLSM/cloud", PointCloud2)
        raw = beams()
        assert raw.wait(lambda received: len(received) >= rospy.get_param("~least_beams"))
        assert maps.wait(lambda received: bool(received) and received[-1].width > 100)
        assert maps.messages[-1].header.frame_id == "map"


if __name__ == "__main__":
    run(TestEmulatedGraph)
