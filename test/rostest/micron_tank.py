#!/usr/bin/env python3
"""A real Tritech Micron in a rectangular tank: four straight walls, no ring around the head."""

import unittest

import numpy as np
from graph import Inbox, recording, rows, run, wait_for_subscribers
from playback import play
from sensor_msgs.msg import PointCloud2

RINGING = 0.4
# Where each wall is (axis, position [m]) and along which part of it [m] nothing else stands.
WALLS = {
    "left": (0, -4.1, (-0.2, 1.4)),
    "right": (0, 4.1, (-1.0, 3.0)),
    "far": (1, 2.2, (-2.5, 2.0)),
    "near": (1, -1.0, (-1.0, 1.5)),
}
BAND = 0.8
PULSE = 0.25


class MicronTank(unittest.TestCase):
    """Plays the recording once for all tests."""

    @classmethod
    def setUpClass(cls) -> None:
        bag = recording("micron_static.bag")
        maps = Inbox("/MLSM/cloud", PointCloud2)
        scans = Inbox("/sonar/scan/cleaned/cloud", PointCloud2)
        wait_for_subscribers("/sonar/raw", 1)
        scans.wait_for_link()
        play(bag, rate=4)
        last = scans.wait_for_number(2)[-1]
        cls.blocks = rows(maps.wait_for(lambda cloud: cloud.header.stamp == last.header.stamp))

    def test_four_walls_stand_as_straight_lines(self) -> None:
        """Blocks along each wall scatter about one line by no more than the length of the pulse."""
        for name, (axis, position, (first, last)) in WALLS.items():
            across, along = self.blocks[:, axis], self.blocks[:, 1 - axis]
            on_wall = (np.abs(across - position) < BAND) & (along > first) & (along < last)
            self.assertGreater(np.count_nonzero(on_wall), 30, name)
            self.assertLess(longest_gap(along[on_wall], first, last), 0.5, name)
            slope, offset = np.polyfit(along[on_wall], across[on_wall], 1)
            residual = across[on_wall] - slope * along[on_wall] - offset
            self.assertLess(residual.std(), PULSE, name)
            self.assertLess(abs(slope), np.tan(np.radians(10.0)), name)
            self.assertLess(abs(offset - position), 0.4, name)

    def test_the_ring_around_the_head_is_gone(self) -> None:
        """Nothing is drawn where only the head's own ringing is heard."""
        self.assertGreater(np.linalg.norm(self.blocks[:, :2], axis=1).min(), RINGING)


def longest_gap(positions: np.ndarray, first: float, last: float) -> float:
    """Return the longest stretch of the wall without a block, m."""
    return float(np.diff(np.sort(np.concatenate([[first], positions, [last]]))).max())


if __name__ == "__main__":
    run(MicronTank)
