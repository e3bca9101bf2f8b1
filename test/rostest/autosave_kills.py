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
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Dict, Set

import numpy as np
import rospy
import rostest
from geometry_msgs.msg import Point
from graph import PACKAGE_ROOT, wait_for_publisher_links, wait_until

from mlsm_manager.surface_map.files.map_file import read_map
from sonar_processing.cloud import IntensityCloud
from sonar_processing.ros.conversions import cloud_to_message
from underwater_map_construction.msg import StampedIntensityCloud
from underwater_map_construction.srv import GetRegion

PERIOD = 0.3
# s: a cloud on its way into the map and a file on its way to the disk, on a machine with other work.
LATENCY = 1.0
CLOUD_PERIOD = 0.05
# Nodes at the same time: they mostly wait for clouds and for the time of their death.
NODES = 4


class KilledNode:
    """A node in a namespace of its own, to which one block after the other is sent, block k at x = k m."""

    def __init__(self, namespace: str, folder: Path) -> None:
        self.folder = folder
        self._namespace = namespace
        rospy.set_param(f"{namespace}/mlsm_core/map_directory", str(folder))
        rospy.set_param(f"{namespace}/mlsm_core/autosave_period", PERIOD)
        rospy.set_param(f"{namespace}/mlsm_core/estimator", rospy.get_param("/mlsm_core/estimator"))
        self._publisher = rospy.Publisher(f"{namespace}/sonar/scan/cleaned", StampedIntensityCloud, queue_size=10)
        self._get_region = f"{namespace}/mlsm_core/get_region"
        self._sent = 0

    def die_often(self, kills: int) -> Set[int]:
        """Start and kill the node; return the blocks that it must have saved. Raises AssertionError where it did not.

        The map after each start holds all that was sent until shortly before the kill.
        """
        saved: Set[int] = set()
        for kill in range(kills):
            node = self._started()
            try:
                assert saved <= self._held(), f"lost by kill {kill} of {self._namespace}: {saved - self._held()}"
                sent_at = self._feed(random.uniform(0.0, 1.5))
            finally:
                node.send_signal(signal.SIGKILL)
                killed = time.monotonic()
                node.wait()
            self._assert_files_are_whole()
            saved |= {block for block, sent in sent_at.items() if sent < killed - PERIOD - LATENCY}
        return saved

    def _started(self) -> "subprocess.Popen[bytes]":
        command = [str(PACKAGE_ROOT / "nodes/mlsm_core"), f"__ns:={self._namespace}"]
        node = subprocess.Popen(command, start_new_session=True)
        try:
            wait_until(self._answers, timeout=30.0)
            wait_for_publisher_links(self._publisher, 1, timeout=30.0)
        except AssertionError:
            node.kill()
            raise
        return node

    def _answers(self) -> bool:
        try:
            self._held()
        except (rospy.ServiceException, OSError):
            return False
        return True

    def _held(self) -> Set[int]:
        """Return the numbers of the blocks that the node holds."""
        cloud = rospy.ServiceProxy(self._get_region, GetRegion)(Point(-1, -1, -9), Point(1e4, 1, 9)).cloud
        rows = np.frombuffer(cloud.data, dtype=np.float32).reshape(-1, len(cloud.fields))
        return set(np.floor(rows[:, 0]).astype(int).tolist())

    def _feed(self, seconds: float) -> Dict[int, float]:
        """Send a block every CLOUD_PERIOD; return when each was sent."""
        sent_at, end = {}, time.monotonic() + seconds + PERIOD + LATENCY
        rate = rospy.Rate(1.0 / CLOUD_PERIOD)
        while time.monotonic() < end:
            now = rospy.Time.now()
            points = np.array([[self._sent + 0.1, 0.1, -1.0, 50.0]], dtype=np.float32)
            cloud = IntensityCloud(points, np.array([-now.to_sec()]), now.to_nsec(), "odom")
            self._publisher.publish(cloud_to_message(cloud))
            sent_at[self._sent] = time.monotonic()
            self._sent += 1
            rate.sleep()
        return sent_at

    def _assert_files_are_whole(self) -> None:
        for path in self.folder.glob("*.mlsm"):
            assert len(read_map(path)) > 0, path


class AutosaveKills(unittest.TestCase):
    """Nodes are killed `~kills` times altogether."""

    def test_no_kill_loses_more_than_the_last_moments(self) -> None:
        """No node loses what it was sent until shortly before its kill, and none leaves a broken file."""
        folder = Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, str(folder))
        nodes = [self._node(folder / str(number), f"/vehicle_{number}") for number in range(NODES)]
        with ThreadPoolExecutor(NODES) as pool:
            saved = list(pool.map(lambda node: node.die_often(rospy.get_param("~kills") // NODES), nodes))
        self.assertTrue(all(saved), saved)

    def _node(self, folder: Path, namespace: str) -> KilledNode:
        folder.mkdir()
        return KilledNode(namespace, folder)


if __name__ == "__main__":
    rospy.init_node("autosave_kills")
    rostest.rosrun("underwater_map_construction", "autosave_kills", AutosaveKills, sys.argv)
