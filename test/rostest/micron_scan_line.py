#!/usr/bin/env python3
"""A real Micron of another team, in its own message type and without any tf: every beam arrives in the map."""

import unittest

import numpy as np
from graph import LONG_PATIENCE, Diagnostics, Inbox, launch, recording, rows, run
from sensor_msgs.msg import PointCloud2

BEAMS = 2028
TURNS = 10
ARGUMENTS = (
    "beams:=/micron_driver/scan_line", "standing:=true", "rate:=4", "scan_size:=200", "resolution:=0.1", "rviz:=false"
)  # fmt: skip


class MicronScanLine(unittest.TestCase):
    """Plays the recording once, as a user does."""

    @classmethod
    def setUpClass(cls) -> None:
        bag = recording("micron_scanline.bag")
        cls.diagnostics = Diagnostics()
        cls.map = Inbox("/MLSM/cloud", PointCloud2)
        cls.turns = Inbox("/sonar/scan/polar/cloud", PointCloud2)
        launch(cls.addClassCleanup, "play_bag.launch", f"bag:={bag}", *ARGUMENTS)
        cls.diagnostics.wait_for("sonar_to_cloud", "beams placed", BEAMS, LONG_PATIENCE)

    def test_no_beam_is_lost(self) -> None:
        values = self.diagnostics.values("sonar_to_cloud")
        self.assertEqual((values["beams in"], values["beams placed"]), (str(BEAMS), str(BEAMS)))
        self.assertFalse({"beams refused", "beams without transform", "internal errors"} & set(values))

    def test_every_turn_is_a_scan(self) -> None:
        self.diagnostics.wait_for("sonar_to_cloud", "turns", TURNS)
        self.assertEqual({cloud.height for cloud in self.turns.wait_for_number(TURNS - 1)[1:]}, {200})

    def test_the_map_holds_the_wall(self) -> None:
        """Most blocks lie where the loudest echoes of the recording are, 3 to 10 m from the head."""
        blocks = rows(self.map.wait_for(lambda cloud: cloud.width > 100))
        distances = np.linalg.norm(blocks[:, :2], axis=1)
        self.assertLess(np.percentile(distances, 5), 8.0)
        self.assertGreater(np.percentile(distances, 50), 3.0)
        self.assertLess(distances.max(), 10.3)


if __name__ == "__main__":
    run(MicronScanLine)
