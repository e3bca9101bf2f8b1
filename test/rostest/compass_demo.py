#!/usr/bin/env python3
"""A vehicle with a compass alone finds its way through the simulated harbour; its odometry comes from the fixes.

Parameter ~odometry: the profile.
"""

import sys
import unittest

import numpy as np
import rospy
import rostest
from fixes_and_truth import followed, stamps_and_places
from graph import PACKAGE, Inbox
from nav_msgs.msg import Odometry

FIXES = 14  # about four minutes, in which the vehicle goes 30 m
FARTHEST = 3.0  # m, median distance of the fixes from the truth
LEAST_WAY = 15.0  # m by which a vehicle that believes to stand still would be wrong at the end
LEAST_SHARE = 0.8  # of the fixes that are as near as they say: three deviations hold for nearly all


class CompassDemo(unittest.TestCase):
    """Runs the tour's first minutes."""

    def test_the_fixes_follow_the_truth(self) -> None:
        """Both begin at the same place; the odometry moves too, because it is told the velocity."""
        odometry = Inbox("/odom", Odometry)
        odometry_argument = f"odometry:={rospy.get_param('~odometry')}"
        arguments = [odometry_argument, "real_time_factor:=12.0", "shapes:=false", "rviz:=false"]
        found = followed("demo.launch", arguments, FIXES)
        self.assertLess(np.median(found.errors), FARTHEST)
        self.assertGreaterEqual(found.share_as_told, LEAST_SHARE, f"errors {found.errors}, told {found.told}")
        self.assertGreater(found.way, LEAST_WAY)
        self.assertGreater(np.ptp(stamps_and_places(odometry.messages)[1], axis=0).max(), 3.0)


if __name__ == "__main__":
    rospy.init_node("compass_demo_test")
    rostest.rosrun(PACKAGE, "compass_demo", CompassDemo, sys.argv)
