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
    def test_every_beam_and_every_turn_of_a_real_recording_arrives_in_the_map(self) -> None:
        bag = recording("micron_scanline.bag")
        diagnostics, turns = Diagnostics(), Inbox("/sonar/scan/polar/cloud", PointCloud2)
        blocks = Inbox("/MLSM/cloud", PointCloud2)
        launch(self.addCleanup, "play_bag.launch", f"bag:={bag}", *ARGUMENTS)
        diagnostics.wait_for("sonar_to_cloud", "beams placed", BEAMS, LONG_PATIENCE)
        values = diagnostics.values("sonar_to_cloud")
        self.assertEqual((values["beams in"], values["beams placed"]), (str(BEAMS), str(BEAMS)))
        self.assertFalse({"beams refused", "beams without transform", "internal errors"} & set(values))
        diagnostics.wait_for("sonar_to_cloud", "turns", TURNS)
        self.assertEqual({cloud.height for cloud in turns.wait_for_number(TURNS - 1)[1:]}, {200})
        # The loudest echoes of the recording are 3 to 10 m from the head.
        distances = np.linalg.norm(rows(blocks.wait_for(lambda cloud: cloud.width > 100))[:, :2], axis=1)
        self.assertLess(np.percentile(distances, 5), 8.0)
        self.assertGreater(np.percentile(distances, 50), 3.0)
        self.assertLess(distances.max(), 10.3)


if __name__ == "__main__":
    run(MicronScanLine)
