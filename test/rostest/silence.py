#!/usr/bin/env python3
"""A vehicle with a compass alone hears nothing for two minutes, moves on, and finds itself again in its own map."""

import unittest
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph import LONG_PATIENCE, Diagnostics, Inbox, publisher, run
from messages import place, true_places, variance
from nav_msgs.msg import Odometry
from std_msgs.msg import Header

from underwater_map_construction.msg import SonarScanLine, StampedIntensityCloud

SILENCE = 120.0, 240.0  # s into the run
KNOWN = 2.0  # m told, from which on the place is known
FARTHEST = 3.0  # deviations that both fixes tell, of the way between them from the true one


class Silence(unittest.TestCase):
    """Hands the simulated head's beams on, but for those of the silence, and their echoes to the simulator."""

    def test_the_vehicle_is_found_again(self) -> None:
        """The first fix that claims to be good is as near the truth as it tells, and the node says that it is found."""
        truth, fixes = Inbox("/ground_truth", Odometry), Inbox("/MLSM/pose", PoseWithCovarianceStamped)
        diagnostics = Diagnostics()
        self.heard = publisher("/heard", SonarScanLine)
        self.paced = publisher("/paced", StampedIntensityCloud)
        self.first, self.silent = np.nan, False
        rospy.Subscriber("/sonar/scan/echoes", StampedIntensityCloud, self.paced.publish, queue_size=10)
        rospy.Subscriber("/sonar/raw", SonarScanLine, self._hand_on, queue_size=1000)
        diagnostics.wait_for("mlsm_core", "times found again after a silence", 1, LONG_PATIENCE)
        found = fixes.wait_for(lambda fix: self._seconds(fix) > SILENCE[1] and variance(fix) < KNOWN**2, LONG_PATIENCE)
        truth.wait_for(lambda message: message.header.stamp >= found.header.stamp)
        before = next(fix for fix in fixes.messages if self._seconds(fix) > SILENCE[0] / 2.0)
        moved, true = place(found) - place(before), np.subtract(*true_places(truth.messages, [found, before]))
        covered = FARTHEST * np.sqrt(variance(found) + variance(before))
        self.assertGreater(np.hypot(*true), covered)
        self.assertLess(np.hypot(*(moved - true)), covered)

    def _hand_on(self, beam: SonarScanLine) -> None:
        self.first = np.nanmin([self.first, beam.header.stamp.to_sec()])
        if not SILENCE[0] <= self._seconds(beam) < SILENCE[1]:
            self.heard.publish(beam)
        elif not self.silent:
            self.silent = True
            # The simulator would wait a minute for the echoes of beams that nobody heard.
            end = rospy.Time.from_sec(self.first + SILENCE[1])
            self.paced.publish(StampedIntensityCloud(header=Header(stamp=end)))

    def _seconds(self, message: Any) -> float:
        return message.header.stamp.to_sec() - self.first


if __name__ == "__main__":
    run(Silence)
