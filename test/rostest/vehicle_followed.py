#!/usr/bin/env python3
"""A vehicle without a DVL, as a launch file of the package runs it, is where its fixes say.

Parameters: ~launch_file, ~arguments (separated by blanks), ~fixes: how many are compared, ~farthest: m, median distance
of the fixes from the truth, ~least_way: m, by which a vehicle that believes to stand still would be wrong at the end,
~least_reckoned: m, by which the odometry moves, because it is told the velocity; without it nothing is asked of it.
"""

import unittest
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph import LONG_PATIENCE, Inbox, launch, run
from messages import stamps_and_places, true_places, variance
from nav_msgs.msg import Odometry

TOLD = 3.0  # stated deviations within which an error is expected
LEAST_SHARE = 0.8  # of the fixes that are as near as they say: three deviations hold for nearly all


class VehicleFollowed(unittest.TestCase):
    """Runs a tour's beginning."""

    def test_the_fixes_follow_the_truth_as_well_as_they_say(self) -> None:
        """Truth and fixes begin at the first fix."""
        truth, odometry = Inbox("/ground_truth", Odometry), Inbox("/odom", Odometry)
        fixes, count = Inbox("/MLSM/pose", PoseWithCovarianceStamped), given("fixes")
        launch(self.addCleanup, given("launch_file"), *given("arguments").split())
        found = fixes.wait_for_number(count, LONG_PATIENCE)[:count]
        truth.wait_for(lambda message: message.header.stamp >= found[-1].header.stamp)
        fixed, there = stamps_and_places(found)[1], true_places(truth.messages, found)
        errors = np.hypot(*((fixed - fixed[0]) - (there - there[0])).T)[1:]
        variances = np.array([variance(fix) for fix in found])
        told = np.sqrt(variances[1:] + variances[0])
        self.assertLess(np.median(errors), given("farthest"), f"errors {errors}, told {told}")
        self.assertGreaterEqual(np.mean(errors <= TOLD * told), LEAST_SHARE, f"errors {errors}, told {told}")
        self.assertGreater(np.hypot(*(there[-1] - there[0])), given("least_way"))
        if rospy.has_param("~least_reckoned"):
            reckoned = np.ptp(stamps_and_places(odometry.messages)[1], axis=0).max()
            self.assertGreater(reckoned, given("least_reckoned"))


def given(name: str) -> Any:
    """Return a parameter of the test."""
    return rospy.get_param(f"~{name}")


if __name__ == "__main__":
    run(VehicleFollowed)
