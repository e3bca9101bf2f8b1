#!/usr/bin/env python3
"""A vehicle whose odometry is 30 % wrong knows where it is, once startMatching says so (thesis 7.4)."""

import unittest
from contextlib import ExitStack

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph import LONG_PATIENCE, PACKAGE_ROOT, Diagnostics, Inbox, launched, run, wait_for_publisher_links
from messages import stamps_and_places, true_places, variance
from nav_msgs.msg import Odometry, Path
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

SCANS = 6
SIMULATION = (
    f"yaml:={PACKAGE_ROOT}/yaml/sonar_simulator_demo.yaml",
    f"script:={PACKAGE_ROOT}/yaml/thesis_moves.yaml",
    "real_time_factor:=8.0",
    "odometry_error:=0.3",
)


class Matching(unittest.TestCase):
    """Three moves of 5.2, 3.9 and -10.4 m that the odometry believes to be 4, 3 and -8 m."""

    @classmethod
    def setUpClass(cls) -> None:
        """Start matching, then the simulation, and wait until the whole tour is matched."""
        cls.truth = Inbox("/ground_truth", Odometry)
        cls.transforms = Inbox("/tf", TFMessage)
        cls.fixes = Inbox("/MLSM/odometry", Odometry)
        cls.poses = Inbox("/MLSM/pose", PoseWithCovarianceStamped)
        cls.starter = rospy.Publisher("/startMatching", Bool, queue_size=1, latch=True)
        cls.starter.publish(True)
        cls.diagnostics = Diagnostics()
        wait_for_publisher_links(cls.starter, 1)
        for inbox in (cls.transforms, cls.fixes, cls.poses):
            inbox.wait_for_link()
        simulation = ExitStack()
        cls.addClassCleanup(simulation.close)
        simulation.enter_context(launched("sonar_simulator.launch", *SIMULATION))
        last = cls.fixes.wait_for_number(SCANS, LONG_PATIENCE)[SCANS - 1]
        cls.truth.wait_for(lambda message: message.header.stamp >= last.header.stamp)

    def errors(self) -> np.ndarray:
        """Return the distance of each fix of the tour from the truth at its stamp, m."""
        fixes = self.fixes.messages[:SCANS]
        return np.linalg.norm(stamps_and_places(fixes)[1] - true_places(self.truth.messages, fixes), axis=1)

    def test_every_fix_is_close_to_the_truth(self) -> None:
        """Published for these moves: 0.15, 0.37 and 0.28 m."""
        errors = self.errors()
        self.assertGreaterEqual(len(errors), SCANS)
        self.assertLess(errors.max(), 0.2, errors)
        self.assertLess(np.median(errors), 0.1, errors)

    def test_the_fix_says_honestly_how_sure_it_is(self) -> None:
        """No fix is off by more than four of its own deviations, nor less sure than half a metre."""
        variances = np.array([variance(fix) for fix in self.fixes.messages[:SCANS]])
        self.assertLess((self.errors() / np.sqrt(variances)).max(), 4.0)
        self.assertLess(variances.max(), 0.5**2, variances)

    def test_map_to_odom_holds_the_corrections_of_the_thesis(self) -> None:
        """At the end -1.2 m in x and 0.9 m in y, never twice with one stamp, and x is not reached by a jump."""
        self.transforms.wait_for(is_corrected)
        transforms = [t for m in self.transforms.messages for t in m.transforms if t.header.frame_id == "map"]
        in_x = np.array([t.transform.translation.x for t in transforms])
        before_first_correction = in_x[: np.argmax(in_x > 1.0)]
        self.assertGreater(before_first_correction.max(), 0.2)
        self.assertEqual(len({t.header.stamp for t in transforms}), len(transforms))

    def test_pose_and_path_say_the_same_as_the_odometry_message(self) -> None:
        path = Inbox("/MLSM/path", Path).wait_for(lambda way: len(way.poses) >= SCANS)
        poses = self.poses.wait_for_number(SCANS)[:SCANS]
        shapes = [stamps_and_places(found[:SCANS])[1] for found in (self.fixes.messages, path.poses, poses)]
        np.testing.assert_array_equal(shapes[1:], [shapes[0]] * 2)

    def test_the_diagnostics_count_the_matches(self) -> None:
        """The first scan makes the map, the others are matched."""
        self.diagnostics.wait_for("mlsm_core", "scans matched", SCANS)

    def test_the_whole_map_is_searched_on_request(self) -> None:
        """Relocalisation finds the place of the newest scan without knowing anything."""
        answer = rospy.ServiceProxy("/mlsm_core/relocalise", Trigger)()
        self.assertTrue(answer.success, answer.message)


def is_corrected(message: TFMessage) -> bool:
    """Return whether a message of tf holds the map -> odom of the tour's end, within 0.2 m."""
    places = [t.transform.translation for t in message.transforms if t.header.frame_id == "map"]
    return any(max(abs(place.x + 1.2), abs(place.y - 0.9)) < 0.2 for place in places)


if __name__ == "__main__":
    run(Matching)
