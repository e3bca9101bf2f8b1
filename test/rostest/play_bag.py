#!/usr/bin/env python3
"""A recording that play_bag.launch plays makes a map of enough blocks in time; else it is said what was missing."""

import time
import unittest

import rosgraph
import rospy
from graph import Diagnostics, run, wait_until

STAGES = {"sonar_to_cloud": ("beams in", "beams placed", "scans"), "mlsm_core": ("clouds in", "scans in", "blocks")}
"""What each stage counts, in the order of the way of a beam."""
LAST = 30.0  # s: for what the nodes still do when the player has ended


class PlayBag(unittest.TestCase):
    """Waits for the blocks that ~least_blocks asks for, at most ~most_minutes or until the player has ended."""

    def test_the_recording_makes_a_map(self) -> None:
        least, minutes = rospy.get_param("~least_blocks"), rospy.get_param("~most_minutes")
        self.diagnostics, self.heard, self.player_seen = Diagnostics(), time.monotonic(), False
        wait_until(lambda: self.blocks() >= least or self.has_ended(), 60.0 * minutes, required=False)
        told = f"{self.blocks()} blocks, must be at least {least} within {minutes:g} minutes; {self.known()}"
        self.assertGreaterEqual(self.blocks(), least, told)

    def blocks(self) -> int:
        return int(self.diagnostics.values("mlsm_core").get("blocks", 0))

    def has_ended(self) -> bool:
        """Whether the player was there, and has not been for some seconds."""
        try:
            rosgraph.Master("/play_bag_test").lookupNode("/player")
            self.heard, self.player_seen = time.monotonic(), True
        except rosgraph.MasterException:
            pass
        return time.monotonic() > self.heard + (LAST if self.player_seen else 3.0 * LAST)

    def known(self) -> str:
        """Return in words what each stage has counted, and what it complains of."""
        lines = []
        for stage, counters in STAGES.items():
            values = self.diagnostics.values(stage)
            numbers = [f"{name} {values.get(name, '0')}" for name in counters]
            others = [f"{name}: {value}" for name, value in values.items() if name not in counters and value != "0"]
            lines.append(f"{stage}: {', '.join(numbers)} ({'; '.join(others) or 'reports nothing else'})")
        return "; ".join(lines)


if __name__ == "__main__":
    # rospy's own time follows the recording, and does not begin without one.
    run(PlayBag, disable_rostime=True)
