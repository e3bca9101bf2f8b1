#!/usr/bin/env python3
"""The live graph does on a real marina what map_bag did: live.yaml holds all that it takes."""

import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np
import rosbag
import rospy
import rostest
from graph import TEST_DATA, Diagnostics, Inbox, play, recording, wait_for_subscribers
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

from mlsm_manager.bag_recording import BagNames, read_recording
from mlsm_manager.map_bag_arguments import map_bag_arguments
from mlsm_manager.mapping.recording import scans_of
from mlsm_manager.mapping.replay import Replayed, replay
from mlsm_manager.matching.planar import composed, inverse, wrapped

TOPICS = ("/sonar/raw", "/tf", "/tf_static", "/cmd_vel")
SECONDS = 330.0
RATE = 14.0


class Marina(unittest.TestCase):
    """Plays the first minutes once for all tests."""

    @classmethod
    def setUpClass(cls) -> None:
        """Map the minutes with map_bag's cores, play them, and wait until every scan was matched live."""
        whole = recording("marina_first.bag")
        fixes, transforms = Inbox("/MLSM/odometry", Odometry), Inbox("/tf", TFMessage)
        diagnostics = Diagnostics()
        with tempfile.TemporaryDirectory() as folder:
            piece = Path(folder) / "piece.bag"
            cut(whole, piece)
            cls.replayed = replayed(piece)
            wait_for_subscribers("/sonar/raw", 1)
            play(piece, RATE)
        diagnostics.wait_for("mlsm_core", "scans in", len(cls.replayed.updates))
        cls.fixes = {stamp(fix): pose(fix.pose.pose.position, fix.pose.pose.orientation) for fix in fixes.messages}
        cls.corrections = corrections(transforms)

    def test_it(self) -> None:
        """Print."""
        print(len(self.replayed.updates), self.replayed.matched, len(self.fixes))
        expected = {u.scan.reference_time: u.result for u in self.replayed.updates if u.result is not None}
        for time, found in self.fixes.items():
            nearest = min(expected, key=lambda t: abs(t - time))
            d = found - expected[nearest].pose
            print(f"{time:.3f} {time - nearest:.4f} {d[0]:.4f} {d[1]:.4f} {wrapped(d[2]):.5f}")
        r = self.replayed
        c = composed(r.corrected, inverse(r.odometry))
        times, values = self.corrections
        print(len(times))
        for u in r.updates:
            k = np.searchsorted(times, u.scan.reference_time) - 1
            j = np.searchsorted(r.times, u.scan.reference_time) - 1
            odo = r.odometry[j]
            a, b = composed(values[k], odo), composed(c[j], odo)
            print(
                f"{u.scan.reference_time:.2f} {times[k] - u.scan.reference_time:.3f} {a[:2] - b[:2]} {wrapped(a[2] - b[2]):.5f} {c[j]}"
            )


def cut(whole: Path, piece: Path) -> None:
    """Write the first minutes of what the graph listens to."""
    with rosbag.Bag(str(whole)) as bag, rosbag.Bag(str(piece), "w") as first:
        end = rospy.Time.from_sec(bag.get_start_time() + SECONDS)
        # One topic at a time: they lie in compressed chunks of their own.
        for topic in TOPICS:
            for _, message, time in bag.read_messages(topics=[topic], end_time=end):
                first.write(topic, message, time)


def replayed(bag: Path) -> Replayed:
    """Return what map_bag makes of a bag with the parameters of the live graph."""
    names = BagNames("/sonar/raw", "odom", "base_link", None)
    parameters = map_bag_arguments(
        [str(bag), "--out", "unused", "--parameters", str(TEST_DATA / "marina_live.yaml")]
    ).parameters
    found = read_recording(bag, names)
    scans = [scan for scan, _ in scans_of(found, parameters.echoes())]
    return replay(found, scans, parameters, lambda _: None)


def stamp(message: object) -> float:
    """Return the stamp of a message, s."""
    return message.header.stamp.to_sec()


def pose(position: object, rotation: object) -> np.ndarray:
    """Return x, y [m] and yaw [rad]."""
    return np.array([position.x, position.y, 2.0 * np.arctan2(rotation.z, rotation.w)])


def corrections(transforms: Inbox) -> tuple:
    found = [t for m in transforms.messages for t in m.transforms if t.header.frame_id == "map"]
    return np.array([stamp(t) for t in found]), np.array(
        [pose(t.transform.translation, t.transform.rotation) for t in found]
    )


if __name__ == "__main__":
    rospy.init_node("marina_test")
    rostest.rosrun("underwater_map_construction", "marina", Marina, sys.argv)
