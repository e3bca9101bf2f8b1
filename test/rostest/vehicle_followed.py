#!/usr/bin/env python3
"""A vehicle without a DVL, as a launch file of the package runs it, is where its fixes say.

Parameters: ~launch_file, ~arguments (separated by blanks), ~fixes: how many are compared, ~farthest: m, median distance
of the fixes from the truth, ~least_way: m, by which a vehicle that believes to stand still would be wrong at the end.
"""

import sys
import unittest
from typing import Any

import numpy as np
import rospy
import rostest
from fixes_and_truth import followed
from graph import PACKAGE

LEAST_SHARE = 0.8  # of the fixes that are as near as they say: three deviations hold for nearly all


class VehicleFollowed(unittest.TestCase):
    """Runs a tour's beginning."""

    def test_the_fixes_follow_the_truth_as_well_as_they_say(self) -> None:
        """Truth and fixes begin at the first fix."""
        found = followed(_given("launch_file"), _given("arguments").split(), _given("fixes"))
        self.assertLess(np.median(found.errors), _given("farthest"), f"errors {found.errors}, told {found.told}")
        self.assertGreaterEqual(found.share_as_told, LEAST_SHARE, f"errors {found.errors}, told {found.told}")
        self.assertGreater(found.way, _given("least_way"))


def _given(name: str) -> Any:
    return rospy.get_param(f"~{name}")


if __name__ == "__main__":
    rospy.init_node("vehicle_followed_test")
    rostest.rosrun(PACKAGE, "vehicle_followed", VehicleFollowed, sys.argv)
