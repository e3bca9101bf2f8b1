#!/usr/bin/env python3
"""The demo with the thesis's moves and 30 % of odometry error (7.4): it is corrected, and nothing is warned of."""

import unittest

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph import LONG_PATIENCE, PACKAGE_ROOT, Diagnostics, Inbox, launched, run
from messages import stamps_and_places, true_places, variance
from nav_msgs.msg import Odometry, Path
from rosgraph_msgs.msg import Log
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

SCANS = 6
TOUR = 110.0  # s of the script's 112 that truth and odometry tell of
ERROR = 0.3
# Times real time. At the first a stall of a tenth of a second is one of a second, and may be warned of; slower then.
FACTORS = (10.0, 4.0, 1.0)
TRUE_STOPS = np.array([(5.2, 0.0), (5.2, 3.9), (-5.2, 3.9)])
KINDS = {
    "/rosout": Log, "/ground_truth": Odometry, "/odom": Odometry, "/sonar_simulator/world": Marker, "/tf": TFMessage,
    "/MLSM/Markers": MarkerArray, "/MLSM/odometry": Odometry, "/MLSM/pose": PoseWithCovarianceStamped,
    "/MLSM/path": Path,
}  # fmt: skip


class SimulatorDemo(unittest.TestCase):
    """Three moves of 5.2, 3.9 and -10.4 m that the odometry believes to be 4, 3 and -8 m, once for all tests."""

    @classmethod
    def setUpClass(cls) -> None:
        for factor in FACTORS:
            cls.run_demo(factor)
            if not cls.warned():
                break

    @classmethod
    def run_demo(cls, factor: float) -> None:
        """Listen until the end of the script, which the log tells."""
        cls.inboxes, diagnostics = {topic: Inbox(topic, kind) for topic, kind in KINDS.items()}, Diagnostics()
        logs = cls.inboxes["/rosout"]
        arguments = (f"script:={PACKAGE_ROOT}/yaml/thesis_moves.yaml", f"odometry_error:={ERROR}")
        with launched("demo.launch", *arguments, f"real_time_factor:={factor}", "rviz:=false"):
            ended = "moves have ended after 112 s"
            logs.wait_for(lambda _: any(ended in log.msg for log in logs.messages), LONG_PATIENCE)
            diagnostics.wait_for("mlsm_core", "scans matched", SCANS)
            diagnostics.wait_for("sonar_simulator", "beams out", 800)
            cls.inboxes["/tf"].wait_for(is_corrected)
            cls.relocalised = rospy.ServiceProxy("/mlsm_core/relocalise", Trigger)()
        for inbox in cls.inboxes.values():
            inbox.close()

    @classmethod
    def warned(cls) -> list:
        """Return what was warned of, but for a slow machine."""
        logs = [log for log in cls.inboxes["/rosout"].messages if log.level >= Log.WARN]
        return [f"{log.name}: {log.msg}" for log in logs if "the machine" not in log.msg]

    def places(self, topic: str) -> np.ndarray:
        """Return the stamps and positions (n, 3) of a topic."""
        return np.column_stack(stamps_and_places(self.inboxes[topic].messages))

    def errors(self) -> np.ndarray:
        """Return the distance of each fix of the tour from the truth at its stamp, m."""
        fixes = self.inboxes["/MLSM/odometry"].messages[:SCANS]
        truth = true_places(self.inboxes["/ground_truth"].messages, fixes)
        return np.linalg.norm(stamps_and_places(fixes)[1] - truth, axis=1)

    def test_nothing_is_warned_of(self) -> None:
        self.assertEqual(self.warned(), [])

    def test_the_vehicle_moves_as_its_script_says_and_the_odometry_errs_by_its_parameter(self) -> None:
        true, believed = self.places("/ground_truth"), self.places("/odom")
        stamps, where, there = np.intersect1d(true[:, 0], believed[:, 0], return_indices=True)
        self.assertGreater(np.ptp(stamps), TOUR)
        np.testing.assert_allclose(true[where, 1:], (1.0 + ERROR) * believed[there, 1:], atol=1e-6)
        for stop in TRUE_STOPS:
            self.assertLess(np.linalg.norm(true[:, 1:] - stop, axis=1).min(), 1e-6)

    def test_world_and_map_are_shown(self) -> None:
        self.assertTrue(self.inboxes["/sonar_simulator/world"].messages[-1].points)
        markers = [marker for array in self.inboxes["/MLSM/Markers"].messages for marker in array.markers]
        self.assertTrue(any(marker.points for marker in markers))

    def test_every_fix_is_close_to_the_truth(self) -> None:
        """Published for these moves: 0.15, 0.37 and 0.28 m."""
        errors = self.errors()
        self.assertLess(errors.max(), 0.2, errors)
        self.assertLess(np.median(errors), 0.1, errors)

    def test_the_fix_says_honestly_how_sure_it_is(self) -> None:
        """No fix is off by more than four of its own deviations, nor less sure than half a metre."""
        variances = np.array([variance(fix) for fix in self.inboxes["/MLSM/odometry"].messages[:SCANS]])
        self.assertLess((self.errors() / np.sqrt(variances)).max(), 4.0)
        self.assertLess(variances.max(), 0.5**2, variances)

    def test_map_to_odom_goes_to_a_correction_without_a_jump_and_with_a_new_stamp_each_time(self) -> None:
        transforms = [t for message in self.inboxes["/tf"].messages for t in message.transforms]
        corrections = [t for t in transforms if t.header.frame_id == "map"]
        x = np.array([t.transform.translation.x for t in corrections])
        self.assertTrue(np.any(x[: np.argmax(x > 1.0)] > 0.2), x)
        self.assertEqual(len({t.header.stamp for t in corrections}), len(corrections))

    def test_pose_and_path_say_the_same_as_the_odometry_message(self) -> None:
        fixes, poses = self.places("/MLSM/odometry")[:SCANS, 1:], self.places("/MLSM/pose")[:SCANS, 1:]
        np.testing.assert_array_equal(poses, fixes)
        path = self.inboxes["/MLSM/path"].messages[-1].poses[:SCANS]
        np.testing.assert_array_equal(stamps_and_places(path)[1], fixes)

    def test_the_whole_map_is_searched_on_request(self) -> None:
        """Relocalisation finds the place of the newest scan without knowing anything."""
        self.assertTrue(self.relocalised.success, self.relocalised.message)


def is_corrected(message: TFMessage) -> bool:
    """Return whether a message of tf holds the map -> odom of the tour's end, within 0.2 m."""
    places = [t.transform.translation for t in message.transforms if t.header.frame_id == "map"]
    return any(max(abs(place.x + 1.2), abs(place.y - 0.9)) < 0.2 for place in places)


if __name__ == "__main__":
    run(SimulatorDemo)
