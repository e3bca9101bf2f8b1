#!/usr/bin/env python3
"""A vehicle with a compass alone finds its way through the simulated harbour; its odometry comes from the fixes.

Parameter ~odometry: the profile.
"""

import sys
import unittest

import numpy as np
import rospy
import rostest
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph import LONG_PATIENCE, PACKAGE, Inbox, launched
from nav_msgs.msg import Odometry

FIXES = 14  # about four minutes, in which the vehicle goes 30 m
FARTHEST = 3.0  # m, median distance of the fixes from the truth
LEAST_WAY = 15.0  # m by which a vehicle that believes to stand still would be wrong at the end


class CompassDemo(unittest.TestCase):
    """Runs the tour's first minutes."""

    def test_the_fixes_follow_the_truth(self) -> None:
        """Both begin at the same place; the odometry moves too, because it is told the velocity."""
        truth, odometry = Inbox("/ground_truth", Odometry), Inbox("/odom", Odometry)
        fixes = Inbox("/MLSM/pose", PoseWithCovarianceStamped)
        odometry_argument = f"odometry:={rospy.get_param('~odometry')}"
        arguments = (odometry_argument, "real_time_factor:=12.0", "shapes:=false", "rviz:=false")
        with launched("demo.launch", *arguments):
            times, fixed = _way(fixes.wait_for_number(FIXES, LONG_PATIENCE)[:FIXES])
            truth.wait_for(lambda message: message.header.stamp.to_sec() >= times[-1])
            odometry.wait_for(lambda message: message.header.stamp.to_sec() >= times[-1])
        stamps, true = _way(truth.messages)
        there = np.column_stack([np.interp(times, stamps, true[:, axis]) for axis in (0, 1)])
        error = np.hypot(*((fixed - fixed[0]) - (there - there[0])).T)
        self.assertLess(np.median(error), FARTHEST)
        self.assertGreater(np.hypot(*(there[-1] - there[0])), LEAST_WAY)
        self.assertGreater(np.ptp(_way(odometry.messages)[1], axis=0).max(), 3.0)


def _way(messages: list) -> tuple:
    """Return stamps (n,) s and positions (n, 2) m."""
    rows = [(m.header.stamp.to_sec(), m.pose.pose.position.x, m.pose.pose.position.y) for m in messages]
    values = np.array(rows)
    return values[:, 0], values[:, 1:]


if __name__ == "__main__":
    rospy.init_node("compass_demo_test")
    rostest.rosrun(PACKAGE, "compass_demo", CompassDemo, sys.argv)
