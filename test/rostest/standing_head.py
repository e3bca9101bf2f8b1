#!/usr/bin/env python3
"""A head that stands though it reports that it turns is named while the vehicle goes on."""

import unittest
from pathlib import Path

import rosbag
from graph import LONG_PATIENCE, TEST_DATA, Diagnostics, launch, run, temporary_folder, wait_until

STANDS_FROM = 110.0  # s, of a bag of 160
BEAMS = "/sonar/raw"


class StandingHead(unittest.TestCase):
    """Plays a tour of the basin in which all beams from a moment on hear the same, once for all tests."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.told = {node: Diagnostics(node) for node in ("/mapping", "/alone/mlsm_core")}
        bag = temporary_folder(cls.addClassCleanup) / "standing.bag"
        with_standing_head(TEST_DATA / "basin.bag", bag)
        arguments = f"bag:={bag}", "processes:=one", "rate:=10", "shapes:=false", "rviz:=false"
        launch(cls.addClassCleanup, "play_bag.launch", *arguments)

    def test_mlsm_core_names_it_in_the_process_that_has_the_beams(self) -> None:
        self.assert_named("/mapping")

    def test_mlsm_core_names_it_as_a_node_of_its_own(self) -> None:
        self.assert_named("/alone/mlsm_core")

    def assert_named(self, node: str) -> None:
        """Both look for causes at the same time, which takes a slow machine longer than one."""
        named = "the head stood for "
        wait_until(lambda: named in self.told[node].values("mlsm_core").get("causes", ""), LONG_PATIENCE)


def with_standing_head(source: Path, copy: Path) -> None:
    """Write a copy of a bag whose beams hear from STANDS_FROM on what the one before heard."""
    with rosbag.Bag(str(source)) as bag, rosbag.Bag(str(copy), "w") as broken:
        heard = b""
        for topic, message, time in bag.read_messages():
            if topic == BEAMS and time.to_sec() - bag.get_start_time() > STANDS_FROM:
                message.intensities = heard
            elif topic == BEAMS:
                heard = message.intensities
            broken.write(topic, message, time)


if __name__ == "__main__":
    # rospy's own time follows the recording, and does not begin without one.
    run(StandingHead, disable_rostime=True)
