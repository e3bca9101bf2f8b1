#!/usr/bin/env python3
"""No beam is lost because the process that maps stands still for two seconds, as a busy machine makes it."""

import os
import signal
import sys
import threading
import unittest
import xmlrpc.client

import rosbag
import rosgraph
import rospy
import rostest
from graph import TEST_DATA, Diagnostics, launched

STOP = 2.0  # s


class StoppedProcess(unittest.TestCase):
    """Plays a recording of three minutes in fifteen seconds."""

    def test_every_beam_is_placed(self) -> None:
        """After stops at the beginning, in the middle and before the last beam."""
        with rosbag.Bag(str(TEST_DATA / "basin.bag")) as bag:
            beams = bag.get_message_count("/sonar/raw")
        diagnostics = Diagnostics()
        with launched("play_bag.launch", f"bag:={TEST_DATA}/basin.bag", "rate:=12", "rviz:=false"):
            for placed in (1, beams // 2, beams - 150):
                diagnostics.wait_for("sonar_to_cloud", "beams placed", placed)
                stop("/mapping")
            diagnostics.wait_for("sonar_to_cloud", "beams placed", beams)


def stop(node: str) -> None:
    """Stop a node's process for two seconds."""
    uri = rosgraph.Master("/stopped_process").lookupNode(node)
    _, _, process = xmlrpc.client.ServerProxy(uri).getPid("/stopped_process")
    os.kill(process, signal.SIGSTOP)
    try:
        threading.Event().wait(STOP)
    finally:
        os.kill(process, signal.SIGCONT)


if __name__ == "__main__":
    rospy.init_node("stopped_process")
    rostest.rosrun("underwater_map_construction", "stopped_process", StoppedProcess, sys.argv)
