#!/usr/bin/env python3
"""A node that is killed with -9 at any moment goes on in its map when it is started again."""

import os
import random
import signal
import subprocess
import time
import unittest
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Set

import numpy as np
import rospy
from graph import PATIENCE, forget_links, run, temporary_folder
from messages import still_cloud
from resumed_vehicle import held_points, started_core

from mlsm_manager.surface_map.map_file import read_map
from underwater_map_construction.msg import StampedIntensityCloud

PERIOD = 0.3
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
        rospy.set_param(f"{namespace}/mlsm_core/start_matching", False)
        rospy.set_param(f"{namespace}/mlsm_core/map_input", "CLEANED")
        self._publisher = rospy.Publisher(f"{namespace}/sonar/scan/cleaned", StampedIntensityCloud, queue_size=10)
        self._sent = 0

    def die_often(self, kills: int) -> Set[int]:
        """Start and kill the node; return the blocks that it has saved. Raises AssertionError where it lost one.

        The map after each start holds all that the file held at the kill.
        """
        saved: Set[int] = set()
        for kill in range(kills):
            node = self._started()
            try:
                assert saved <= self._held(), f"lost by kill {kill} of {self._namespace}: {saved - self._held()}"
                self._feed_until_saved()
                self._feed_until(time.monotonic() + random.uniform(0.0, 1.5))
                saved = self._saved()
            finally:
                node.send_signal(signal.SIGKILL)
                node.wait()
                forget_links(self._publisher, StampedIntensityCloud())
            self._assert_files_are_whole()
        return saved

    def held_when_another_starts_it(self) -> Set[int]:
        """Start the node from a shell, as another run of roslaunch would, and return the blocks that it holds."""
        node = self._started("sh", "-c", '"$@"; exit $?', "sh")
        try:
            return self._held()
        finally:
            os.killpg(node.pid, signal.SIGKILL)
            node.wait()

    def _started(self, *starter: str) -> "subprocess.Popen[bytes]":
        return started_core(self._namespace, [self._publisher], starter)

    def _held(self) -> Set[int]:
        """Return the numbers of the blocks that the node holds."""
        return _numbers(held_points(self._namespace))

    def _saved(self) -> Set[int]:
        """Return the numbers of the blocks that the node's files hold."""
        return {
            number
            for path in self.folder.glob("*.mlsm")
            for layer in read_map(path).layers.values()
            for number in _numbers(layer.mean)
        }

    def _feed_until_saved(self) -> None:
        """Send blocks until a file holds one of them: it is saved while others come."""
        first, end = self._sent, time.monotonic() + PATIENCE
        while max(self._saved(), default=-1) < first:
            assert time.monotonic() < end, f"no block of {self._namespace} was saved in {PATIENCE} s"
            self._feed_until(time.monotonic() + PERIOD)

    def _feed_until(self, end: float) -> None:
        """Send a block every CLOUD_PERIOD until a moment of the monotonic clock."""
        rate = rospy.Rate(1.0 / CLOUD_PERIOD)
        while time.monotonic() < end:
            self._publisher.publish(still_cloud([[self._sent + 0.1, 0.1, -1.0, 50.0]]))
            self._sent += 1
            rate.sleep()

    def _assert_files_are_whole(self) -> None:
        for path in self.folder.glob("*.mlsm"):
            assert len(read_map(path)) > 0, path


def _numbers(points: np.ndarray) -> Set[int]:
    """Return the numbers of blocks by their places (n, 2 or more)."""
    return set(np.floor(points[:, 0]).astype(int).tolist())


class AutosaveKills(unittest.TestCase):
    """Nodes are killed `~kills` times altogether."""

    def test_no_kill_loses_what_was_saved(self) -> None:
        """Every node saves while clouds come, loses nothing of that by its kill, and leaves no broken file."""
        folder = temporary_folder(self)
        nodes = [self._node(folder / str(number), f"/vehicle_{number}") for number in range(NODES)]
        with ThreadPoolExecutor(NODES) as pool:
            saved = list(pool.map(lambda node: node.die_often(rospy.get_param("~kills") // NODES), nodes))
        self.assertTrue(all(saved), saved)

    def test_a_node_that_another_process_starts_begins_a_new_map(self) -> None:
        folder = temporary_folder(self)
        node = self._node(folder / "0", "/vehicle_of_two")
        self.assertTrue(node.die_often(1))
        self.assertEqual(node.held_when_another_starts_it(), set())
        self.assertEqual(len(list(node.folder.glob("*.autosave.previous.mlsm"))), 1)

    def _node(self, folder: Path, namespace: str) -> KilledNode:
        folder.mkdir()
        return KilledNode(namespace, folder)


if __name__ == "__main__":
    run(AutosaveKills)
