#!/usr/bin/env python3
"""No message on any topic that a node subscribes to ends it or is an internal error; then a sane scan passes.

Arguments: one or many processes, the number of messages and the seed.
"""

import subprocess
import sys
import threading
import time
import unittest
from contextlib import suppress
from pathlib import Path
from typing import Any, Dict, List, Set, Tuple

import numpy as np
import rosgraph
import rospy
import tf2_ros
from graph import PATIENCE, Diagnostics, Inbox, process_of, publisher, rows, run, wait_until
from messages import transform, turn
from random_messages import RandomMessages
from rosgraph_msgs.msg import Clock
from roslib.message import get_message_class
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from underwater_map_construction.msg import SonarScanLine

SANE_FRAME = "sane_sonar"
FAR = 150.0
BEAMS = 120
PER_SECOND = 1500
BATCH = 50
# What those get who take any type and use some.
TAKEN_AS_ANY_TYPE = {"/sonar/raw": SonarScanLine._type, "/sonar/rays": PointCloud2._type}
NOT_FUZZED = {"/rosout", "/rosout_agg"}
CLOCK_PERIOD = 0.02  # s: what random messages on /clock did to the time is mended after this


class Fuzz(unittest.TestCase):
    """One long test: what it finds depends on all messages before."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.nodes = _launched(sys.argv[1])
        cls.messages, cls.seed = int(sys.argv[2]), int(sys.argv[3])
        cls.diagnostics = Diagnostics()
        threading.Thread(target=_publish_time, daemon=True).start()
        cls.map = Inbox("/MLSM/cloud", PointCloud2).linked()
        wait_until(lambda: cls.nodes <= cls.diagnostics.callers, told=f"not all of {cls.nodes} report")
        cls.processes = _processes()
        cls.topics = _subscribed(cls.processes)

    def test_nothing_that_comes_ends_a_node(self) -> None:
        print(f"{self.messages} messages, seed {self.seed}, {len(self.processes)} nodes, topics {sorted(self.topics)}")
        self._publish()
        self._expect_all_alive()
        self._expect_a_scan()
        # A timer of its own sends map -> odom.
        Inbox("/tf", TFMessage).wait_for(_is_correction)
        self._expect_no_internal_error()
        self._expect_all_alive()

    def _publish(self) -> None:
        source = RandomMessages(self.seed)
        publishers = [(kind, publisher(topic, get_message_class(kind))) for topic, kind in sorted(self.topics.items())]
        start = time.monotonic()
        for number in range(self.messages):
            kind, made = publishers[number % len(publishers)]
            made.publish(source.message(kind))
            if number % BATCH == 0:
                time.sleep(max(start + number / PER_SECOND - time.monotonic(), 0.0))
            if number % 1000 == 0:
                self._expect_all_alive()
        print(f"published in {time.monotonic() - start:.0f} s")

    def _expect_all_alive(self) -> None:
        dead = [node for node, pid in self.processes.items() if not Path(f"/proc/{pid}").exists()]
        self.assertEqual(dead, [])

    def _expect_no_internal_error(self) -> None:
        told = self.diagnostics.all_values()
        values = {name: items.get("internal errors", "0") for name, items in told.items()}
        self.assertEqual({name: count for name, count in values.items() if count != "0"}, {})
        refused = sum(int(n) for items in told.values() for key, n in items.items() if key.endswith("refused"))
        print(f"{refused} refused, by {len(values)} stages")

    def _expect_a_scan(self) -> None:
        """Send good beams far away from all others until the map has them."""
        rospy.Publisher("/startMatching", Bool, queue_size=1, latch=True).publish(Bool(False))
        rospy.wait_for_service("/mlsm_core/reset_map", timeout=PATIENCE)
        rospy.ServiceProxy("/mlsm_core/reset_map", Trigger)()
        transforms = tf2_ros.StaticTransformBroadcaster()
        transforms.sendTransform(transform("odom", SANE_FRAME, x=FAR))
        beams = publisher("/sonar/raw", SonarScanLine)
        end = time.monotonic() + PATIENCE
        while not any(np.any(np.abs(rows(cloud)[:, 0] - FAR) < 30.0) for cloud in self.map.messages):
            self.assertLess(time.monotonic(), end, f"no sane scan in the map; {self.diagnostics.all_values()}")
            for message in turn(time.time(), 1e-4, BEAMS, SANE_FRAME):
                beams.publish(message)
                time.sleep(0.002)
            time.sleep(1.0)


def _is_correction(message: TFMessage) -> bool:
    """Return whether a message of tf holds a map -> odom of the last seconds."""
    now = time.time()
    return any(t.header.frame_id == "map" and abs(t.header.stamp.to_sec() - now) < 5.0 for t in message.transforms)


def _launched(processes: str) -> Set[str]:
    """Return the nodes that publish diagnostics: all that are launched but this one."""
    launch_file = Path(__file__).resolve().parent / "fuzz.launch"
    command = ["roslaunch", "--nodes", str(launch_file), f"processes:={processes}"]
    told = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    return set(told.split()) - {rospy.get_name()}


def _publish_time() -> None:
    """Publish the time as the simulated one, so that nodes subscribe to /clock and recover from what comes there."""
    publisher = rospy.Publisher("/clock", Clock, queue_size=1)
    with suppress(rospy.ROSException):  # the end of this process closes the topic
        while not rospy.is_shutdown():
            publisher.publish(Clock(rospy.Time.from_sec(time.time())))
            time.sleep(CLOCK_PERIOD)


def _processes() -> Dict[str, int]:
    """Return the process of every node but this one and those that belong to ROS."""
    nodes = {node for part in rosgraph.Master("/fuzz").getSystemState() for _, names in part for node in names}
    return {node: process_of(node) for node in nodes - {rospy.get_name(), "/rosout"}}


def _subscribed(processes: Dict[str, int]) -> Dict[str, str]:
    """Return topic and type of all that the nodes subscribe to."""
    master = rosgraph.Master("/fuzz")
    _, subscribers, _ = master.getSystemState()
    kinds: List[Tuple[str, str]] = master.getTopicTypes()
    topics: Dict[str, Any] = {
        topic: dict(kinds).get(topic, "*") for topic, nodes in subscribers if set(nodes) & set(processes)
    }
    fuzzed = [(topic, kind) for topic, kind in topics.items() if topic not in NOT_FUZZED]
    return {topic: TAKEN_AS_ANY_TYPE[topic] if kind == "*" else kind for topic, kind in fuzzed}


if __name__ == "__main__":
    run(Fuzz)
