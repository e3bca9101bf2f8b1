#!/usr/bin/env python3
"""play_bag.launch maps a recording of 2015 with its yaml files and thesis:=true, though the mapping stands still."""

import os
import signal
import threading
import unittest

import rosbag
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph import TEST_DATA, Diagnostics, Inbox, launch, process_of, run, temporary_folder
from old_bag import with_old_types
from rosgraph_msgs.msg import Clock, Log
from sensor_msgs.msg import PointCloud2

from mlsm_manager.migrate_yaml import migrated_text
from underwater_map_construction.msg import Wall

BAG = TEST_DATA / "basin.bag"
BEAMS = "/charle/sonar"
FILES = {
    "SonarToCloud": {"sonarSubscribeTopic": BEAMS, "velSubscribeTopic": "/cmd_vel", "dispersedPoints": 10},
    "MLSM_core": {"resolution": 0.6, "maxIterations": 10, "nSamples": 2, "sampleStep": 0.1},
}
"""Parameters as the yaml files of 2015 have them, by the names of their nodes."""
STOP = 2.0  # s: as a busy machine stops a process


class PlayBag(unittest.TestCase):
    """Plays a recording of three minutes in fifteen seconds, and waits for what the launch file alone brings about.

    The definitions of the messages have stayed since 2015, and ROS connects publishers and subscribers by them.
    """

    @classmethod
    def setUpClass(cls) -> None:
        cls.maps, cls.clocks = Inbox("/MLSM/cloud", PointCloud2), Inbox("/clock", Clock)
        cls.ends = Inbox("/rosout", Log, lambda line: " has ended after " in line.msg)
        cls.fixes, cls.diagnostics = Inbox("/MLSM/pose", PoseWithCovarianceStamped), Diagnostics()
        cls.matched, cls.walls = Inbox("/debug_cloud", PointCloud2), Inbox("/sonar/walls/coeff", Wall)
        folder = temporary_folder(cls.addClassCleanup)
        with_old_types(BAG, folder / "old.bag", BEAMS)
        (folder / "ours.yaml").write_text(migrated_text(FILES))
        files = f"bag:={folder / 'old.bag'}", f"parameters:={folder / 'ours.yaml'}"
        arguments = (*files, f"beams:={BEAMS}", "thesis:=true", "rate:=12", "matching:=true", "rviz:=false")
        launch(cls.addClassCleanup, "play_bag.launch", *arguments)
        with rosbag.Bag(str(BAG)) as bag:
            cls.beams = bag.get_message_count("/sonar/raw")
        for placed in (1, cls.beams // 2, cls.beams - 150):
            cls.diagnostics.wait_for("sonar_to_cloud", "beams placed", placed)
            stop("/mapping")

    def test_a_map_grows_and_scans_are_matched(self) -> None:
        self.fixes.wait_for_number(2)
        self.assertEqual(self.maps.wait_for(lambda cloud: cloud.width > 300).header.frame_id, "map")
        self.assertEqual(self.matched.wait_for_number(2)[-1].header.frame_id, "map")
        self.walls.wait_for(lambda wall: wall.distance > 1.0)

    def test_every_beam_is_placed_though_the_mapping_stands_still_for_two_seconds(self) -> None:
        self.diagnostics.wait_for("sonar_to_cloud", "beams placed", self.beams)

    def test_the_log_says_that_the_recording_has_ended(self) -> None:
        self.assertRegex(self.ends.wait_for().msg, r"old\.bag has ended after \d+ s; the map stays, Ctrl-C ends it")

    def test_the_clock_never_stands_still(self) -> None:
        """It goes on in steps of 10 ms of wall time while messages are played."""
        times = [message.clock.to_sec() for message in self.clocks.wait_for_number(500)]
        steps = [later - earlier for earlier, later in zip(times, times[1:])]
        self.assertGreater(min(steps), 0.0)
        self.assertLess(max(steps), 0.3)


def stop(node: str) -> None:
    """Stop a node's process for two seconds."""
    process = process_of(node)
    os.kill(process, signal.SIGSTOP)
    try:
        threading.Event().wait(STOP)
    finally:
        os.kill(process, signal.SIGCONT)


if __name__ == "__main__":
    # rospy itself takes one tick of the clock at a time, and drops the others that come meanwhile.
    run(PlayBag, disable_rostime=True)
