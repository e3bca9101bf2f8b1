#!/usr/bin/env python3
"""A node that is killed with -9 at any moment goes on in its map when it is started again."""

import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path
from typing import Set

import numpy as np
import rospy
import rostest
from geometry_msgs.msg import Point
from graph import wait_for_publisher_links, wait_until

from mlsm_manager.surface_map.files.map_file import read_map
from sonar_processing.cloud import IntensityCloud
from sonar_processing.ros.conversions import cloud_to_message
from underwater_map_construction.msg import StampedIntensityCloud
from underwater_map_construction.srv import GetRegion

PERIOD = 0.3
# s: a cloud on its way into the map and a file on its way to the disk, on a machine with other work.
LATENCY = 1.0
CLOUD_PERIOD = 0.05


class AutosaveKills(unittest.TestCase):
    """The node is killed `~kills` times while one block after the other comes, block k at x = k m."""

    def setUp(self) -> None:
        """Make a folder for the maps and say how the node shall save."""
        self.folder = Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, str(self.folder))
        rospy.set_param("/mlsm_core/map_directory", str(self.folder))
        rospy.set_param("/mlsm_core/autosave_period", PERIOD)
        self.publisher = rospy.Publisher("/sonar/scan/cleaned", StampedIntensityCloud, queue_size=10)
        self.sent = 0

    def test_no_kill_loses_more_than_the_last_moments(self) -> None:
        """The map after each start holds all that was sent until shortly before the kill."""
        saved: Set[int] = set()
        for kill in range(rospy.get_param("~kills")):
            node = self._started()
            self.assertEqual(saved - self._held(), set(), f"lost by kill {kill}")
            sent_at = self._feed(random.uniform(0.0, 1.5))
            node.send_signal(signal.SIGKILL)
            killed = time.monotonic()
            node.wait()
            self._assert_files_are_whole()
            saved |= {block for block, sent in sent_at.items() if sent < killed - PERIOD - LATENCY}
        self.assertGreater(len(saved), 0)

    def _started(self) -> subprocess.Popen:
        node = subprocess.Popen(["rosrun", "underwater_map_construction", "mlsm_core"], start_new_session=True)
        self.addCleanup(lambda: node.poll() is None and node.kill())
        rospy.wait_for_service("/mlsm_core/get_region", 30.0)
        wait_until(self._answers, timeout=30.0)
        wait_for_publisher_links(self.publisher, 1, timeout=30.0)
        return node

    def _answers(self) -> bool:
        try:
            self._held()
        except (rospy.ServiceException, OSError):
            return False
        return True

    def _held(self) -> Set[int]:
        """Return the numbers of the blocks that the node holds."""
        cloud = rospy.ServiceProxy("/mlsm_core/get_region", GetRegion)(Point(-1, -1, -9), Point(1e4, 1, 9)).cloud
        rows = np.frombuffer(cloud.data, dtype=np.float32).reshape(-1, len(cloud.fields))
        return set(np.floor(rows[:, 0]).astype(int).tolist())

    def _feed(self, seconds: float) -> dict:
        """Send a block every CLOUD_PERIOD; return when each was sent."""
        sent_at, end = {}, time.monotonic() + seconds + PERIOD + LATENCY
        rate = rospy.Rate(1.0 / CLOUD_PERIOD)
        while time.monotonic() < end:
            now = rospy.Time.now()
            points = np.array([[self.sent + 0.1, 0.1, -1.0, 50.0]], dtype=np.float32)
            cloud = IntensityCloud(points, np.array([-now.to_sec()]), now.to_nsec(), "odom")
            self.publisher.publish(cloud_to_message(cloud))
            sent_at[self.sent] = time.monotonic()
            self.sent += 1
            rate.sleep()
        return sent_at

    def _assert_files_are_whole(self) -> None:
        for path in self.folder.glob("*.mlsm"):
            self.assertGreater(len(read_map(path)), 0)


if __name__ == "__main__":
    rospy.init_node("autosave_kills")
    rostest.rosrun("underwater_map_construction", "autosave_kills", AutosaveKills, sys.argv)
