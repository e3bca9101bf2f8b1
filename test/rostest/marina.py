#!/usr/bin/env python3
"""The live graph does on a real marina what map_bag did: live.yaml holds all that it takes."""

import tempfile
import unittest
from functools import partial
from pathlib import Path
from typing import Any, List, Sequence, Tuple

import numpy as np
import rosbag
import rospy
from graph import TEST_DATA, Diagnostics, Inbox, recording, rows, run, wait_until
from nav_msgs.msg import Odometry
from playback import Step, play
from scipy.spatial import cKDTree
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage

from mlsm_manager.offline.map_bag import map_bag_arguments
from mlsm_manager.offline.recording import read_recording, scans_of
from mlsm_manager.offline.replay import Replayed, replay
from node_support.geometry import composed, wrapped
from recordings.reader import Request
from sonar_processing.beams.parameters import BeamCorrection
from sonar_processing.filters.echo_extractor import EchoExtractor

TOPICS = ("/sonar/raw", "/tf", "/tf_static", "/cmd_vel")
SECONDS = 294.0  # the last turn is then hardly begun: map_bag alone would map most of one
RATE = 14.0
AFTERWARDS = 1.0  # s until the next beam has shown that a turn has ended
SAME_PLACE = 0.02
SAME_HEADING = 0.001


class Marina(unittest.TestCase):
    """Maps the first minutes with map_bag's cores and plays them, once for all tests."""

    @classmethod
    def setUpClass(cls) -> None:
        """Wait until every scan of the minutes was matched live."""
        whole = recording("marina_first.bag")
        fixes, transforms, diagnostics = Inbox("/MLSM/odometry", Odometry), Inbox("/tf", TFMessage), Diagnostics()
        maps = Inbox("/MLSM/cloud", PointCloud2)
        with tempfile.TemporaryDirectory() as folder:
            minutes = Path(folder) / "minutes.bag"
            cut(whole, minutes)
            cls.replayed = replayed(minutes)
            fixes.linked()
            play(minutes, RATE, steps(cls.replayed, fixes))
        diagnostics.wait_for("mlsm_core", "scans in", len(cls.replayed.updates))
        wait_until(lambda: len(fixes.messages) >= cls.replayed.matched, required=False)
        cls.fixes = poses([(fix, fix.pose.pose.position, fix.pose.pose.orientation) for fix in fixes.messages])
        last = cls.replayed.updates[-1].scan.reference_time
        wait_until(lambda: corrections(transforms)[0][-1] >= last)
        cls.corrections = corrections(transforms)
        whole_map = len(cls.replayed.estimator.shown)
        wait_until(lambda: maps.messages[-1:] and maps.messages[-1].width >= whole_map, required=False)
        cls.map = rows(maps.messages[-1])

    def test_the_scans_that_map_bag_matches_are_matched(self) -> None:
        """All but the first five, which make the first block of the map."""
        self.assertGreaterEqual(self.replayed.matched, len(self.replayed.updates) - 5)
        self.assertEqual(len(self.fixes[0]), self.replayed.matched)

    def test_every_fix_is_the_one_of_map_bag(self) -> None:
        """With beams corrected by sonar_to_cloud and scans by mlsm_core, though the odometry is off by metres."""
        matched = [update for update in self.replayed.updates if update.result is not None]
        stamps, found = self.fixes
        np.testing.assert_allclose(stamps, [update.scan.reference_time for update in matched], rtol=0.0, atol=1e-3)
        errors = found - [update.result.pose for update in matched]
        self.assertLess(np.hypot(*errors[:, :2].T).max(), SAME_PLACE)
        self.assertLess(np.abs(wrapped(errors[:, 2])).max(), SAME_HEADING)

    def test_the_map_that_is_shown_is_the_one_of_map_bag(self) -> None:
        """Made of the echoes that are matched, not of the cleaned clouds."""
        expected = self.replayed.estimator.shown.blocks.mean[:, :2]
        distances, _ = cKDTree(expected).query(self.map[:, :2])
        self.assertAlmostEqual(len(self.map) / len(expected), 1.0, delta=0.05)
        self.assertLess(np.quantile(distances, 0.95), 0.1)

    def test_map_to_odom_follows_what_map_bag_calls_corrected(self) -> None:
        """At the end of each scan, when nothing is on the way; what is corrected is more than three times as large."""
        run, (times, sent) = self.replayed, self.corrections
        ends = [update.scan.reference_time for update in run.updates[1:]]
        known = np.searchsorted(run.times, ends) - 1
        live = composed(sent[np.searchsorted(times, ends) - 1], run.odometry[known])
        self.assertLess(np.median(np.hypot(*(live - run.corrected[known])[:, :2].T)), 0.1)
        self.assertGreater(np.median(np.hypot(*(run.odometry - run.corrected)[known, :2].T)), 0.3)


def steps(run: Replayed, fixes: Inbox) -> List[Step]:
    """Wait for the fix of each scan that map_bag matches, shortly after what it is matched with is played."""
    found, counts = [], np.cumsum([update.result is not None for update in run.updates])
    for update, count in zip(run.updates, counts):
        wait = partial(fixes.wait_for_number, int(count))
        found.append((update.scan.reference_time + run.estimator.lookahead + AFTERWARDS, wait))
    return found


def cut(whole: Path, minutes: Path) -> None:
    """Write the first minutes of what the graph listens to."""
    with rosbag.Bag(str(whole)) as bag, rosbag.Bag(str(minutes), "w") as first:
        end = rospy.Time.from_sec(bag.get_start_time() + SECONDS)
        # One topic at a time: they lie in compressed chunks of their own.
        for topic in TOPICS:
            for _, message, time in bag.read_messages(topics=[topic], end_time=end):
                first.write(topic, message, time)


def replayed(bag: Path) -> Replayed:
    """Return what map_bag makes of a bag with the parameters of the live graph."""
    options = [str(bag), "--out", "nowhere", "--parameters", str(TEST_DATA / "marina_live.yaml")]
    parameters = map_bag_arguments(options).parameters
    raw = read_recording(bag, Request())
    found = raw.corrected(parameters.part(BeamCorrection))
    return replay(
        found, [scan for scan, _ in scans_of(found, EchoExtractor(parameters.echoes()))], parameters, lambda _: None
    )


def corrections(transforms: Inbox) -> Tuple[np.ndarray, np.ndarray]:
    """Return stamps (n,) and T_map_odom (n, 3) that were sent."""
    found = [t for message in transforms.messages for t in message.transforms if t.header.frame_id == "map"]
    return poses([(t, t.transform.translation, t.transform.rotation) for t in found])


def poses(stamped: Sequence[Tuple[Any, Any, Any]]) -> Tuple[np.ndarray, np.ndarray]:
    """Return stamps (n,) [s] and x, y [m] and yaw [rad] (n, 3) of messages with their positions and level rotations."""
    values = [(at.x, at.y, 2.0 * np.arctan2(turn.z, turn.w)) for _, at, turn in stamped]
    return np.array([message.header.stamp.to_sec() for message, _, _ in stamped]), np.array(values)


if __name__ == "__main__":
    run(Marina)
