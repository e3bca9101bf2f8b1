#!/usr/bin/env python3
"""play_bag.launch maps a recording by itself, whatever else the recording holds."""

import sys
import unittest

import rospy
import rostest
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph import Inbox, rows
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2


class PlayBag(unittest.TestCase):
    """Waits for what the launch file alone brings about."""

    def test_a_map_grows_and_scans_are_matched(self) -> None:
        """Without anybody to start the player."""
        maps = Inbox("/MLSM/cloud", PointCloud2)
        fixes = Inbox("/MLSM/pose", PoseWithCovarianceStamped)
        fixes.wait_for(lambda _: len(fixes.messages) >= 2)
        self.assertGreater(len(rows(maps.messages[-1])), 300)

    def test_the_clock_never_stands_still(self) -> None:
        """It goes on in steps of 10 ms of wall time while messages are played."""
        clocks = Inbox("/clock", Clock)
        clocks.wait_for(lambda _: len(clocks.messages) >= 500)
        times = [message.clock.to_sec() for message in clocks.messages]
        steps = [later - earlier for earlier, later in zip(times, times[1:])]
        self.assertGreater(min(steps), 0.0)
        self.assertLess(max(steps), 0.3)


if __name__ == "__main__":
    # rospy itself takes one tick of the clock at a time, and drops the others that come meanwhile.
    rospy.init_node("play_bag_test", disable_rostime=True)
    rostest.rosrun("underwater_map_construction", "play_bag", PlayBag, sys.argv)
