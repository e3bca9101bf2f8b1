#!/usr/bin/env python3
"""play_bag.launch and map_bag map a bag of avora_msgs types as it is, without `rosbag fix`."""

import subprocess
import unittest

from graph import LONG_PATIENCE, PACKAGE, TEST_DATA, Inbox, launched, run, temporary_folder
from old_bag import with_old_types
from sensor_msgs.msg import PointCloud2


class PlayOldBag(unittest.TestCase):
    """A recording of today under the names of 2015."""

    def setUp(self) -> None:
        self.folder = temporary_folder(self)
        self.bag = self.folder / "old.bag"
        with_old_types(TEST_DATA / "basin.bag", self.bag)

    def test_play_bag_maps_it(self) -> None:
        """The definitions of the messages have stayed, and ROS connects publishers and subscribers by them."""
        maps = Inbox("/MLSM/cloud", PointCloud2)
        with launched("play_bag.launch", f"bag:={self.bag}", "rate:=20", "rviz:=false"):
            found = maps.wait_for(lambda cloud: cloud.width > 300)
        self.assertEqual(found.header.frame_id, "map")

    def test_map_bag_maps_it(self) -> None:
        command = ["rosrun", PACKAGE, "map_bag", str(self.bag), "--out", str(self.folder / "map"), "--no-calibrate"]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=LONG_PATIENCE, check=True)
        self.assertRegex(done.stdout, r"^10 scans, [1-9]\d* matched, 0 rejected")


if __name__ == "__main__":
    run(PlayOldBag)
