#!/usr/bin/env python3
"""play_bag.launch maps a recording by itself, whatever else the recording holds."""

import sys
import unittest
from contextlib import ExitStack

import rospy
import rostest
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph import TEST_DATA, Inbox, launched
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2


class PlayBag(unittest.TestCase):
    """Waits for what the launch file alone brings about."""

    @classmethod
    def setUpClass(cls) -> None:
        """Listen before the launch file is started."""
        cls.maps, cls.clocks = Inbox("/MLSM/cloud", PointCloud2), Inbox("/clock", Clock)
        cls.fixes = Inbox("/MLSM/pose", PoseWithCovarianceStamped)
        playback = ExitStack()
        cls.addClassCleanup(playback.close)
        arguments = (f"bag:={TEST_DATA}/basin.bag", "rate:=20", "matching:=true", "rviz:=false")
        playback.enter_context(launched("play_bag.launch", *arguments))

    def test_a_map_grows_and_scans_are_matched(self) -> None:
        """Without anybody to start the player."""
        self.fixes.wait_for_number(2)
        self.maps.wait_for(lambda cloud: cloud.width > 300)

    def test_the_clock_never_stands_still(self) -> None:
        """It goes on in steps of 10 ms of wall time while messages are played."""
        times = [message.clock.to_sec() for message in self.clocks.wait_for_number(500)]
        steps = [later - earlier for earlier, later in zip(times, times[1:])]
        self.assertGreater(min(steps), 0.0)
        self.assertLess(max(steps), 0.3)


if __name__ == "__main__":
    # rospy itself takes one tick of the clock at a time, and drops the others that come meanwhile.
    rospy.init_node("play_bag_test", disable_rostime=True)
    rostest.rosrun("underwater_map_construction", "play_bag", PlayBag, sys.argv)
