#!/usr/bin/env python3
"""An autopilot gets positions, in its axes and its time, only while they are good."""

import math
import threading
import unittest

import numpy as np
import rospy
from autopilot_peer import Peer
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph import Diagnostics, publisher, run, wait_until
from messages import transform
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from tf2_msgs.msg import TFMessage

from underwater_map_construction.msg import PositionStatus

DEPTH = 5.0
PRESSURE = (101325.0 + 1000.0 * 9.80665 * DEPTH) / 100.0  # hPa
HEADING = math.radians(30.0)
PERIOD = 0.05  # s between two headings


class AutopilotLink(unittest.TestCase):
    """The vehicle stands at (3, 4) m of the map; mlsm_core is this test."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.diagnostics = Diagnostics("/autopilot_link")
        wait_until(lambda: "connection" in cls.diagnostics.values("autopilot_link"))
        cls.peer = Peer(cls.diagnostics.values("autopilot_link")["connection"])
        cls.x, cls.state = 3.0, PositionStatus.PROVISIONAL
        cls.transforms = publisher("/tf", TFMessage, listeners=2)
        cls.statuses = publisher("/MLSM/status", PositionStatus)
        cls.fixes = publisher("/MLSM/pose", PoseWithCovarianceStamped)
        cls.closing = threading.Event()
        threading.Thread(target=cls._live, daemon=True).start()
        wait_until(lambda: "round trip [ms]" in cls.diagnostics.values("autopilot_link"))

    @classmethod
    def tearDownClass(cls) -> None:
        cls.closing.set()
        cls.peer.close()

    @classmethod
    def _live(cls) -> None:
        """Be the autopilot's instruments and mlsm_core."""
        while not cls.closing.wait(PERIOD):
            boot_ms = cls.peer.now_ns() // 10**6
            cls.peer.send(mavlink.MAVLink_scaled_pressure2_message(boot_ms, PRESSURE, 0.0, 0))
            cls.peer.send(mavlink.MAVLink_attitude_message(boot_ms, 0.0, 0.0, HEADING, 0.0, 0.0, 0.0))
            ahead = rospy.get_time() + 1.0
            cls.transforms.publish([transform("map", "odom", ahead, cls.x)])
            status = PositionStatus(state=cls.state, text="position provisional", age=1.0)
            status.covariance = (0.04 * np.eye(3)).ravel().tolist()
            cls.statuses.publish(status)

    def _next(self, number: int = 1) -> list:
        """Return the next positions that the autopilot gets."""
        before = len(self.peer.of_type("ODOMETRY"))
        wait_until(lambda: len(self.peer.of_type("ODOMETRY")) >= before + number, told="no positions")
        return self.peer.of_type("ODOMETRY")[before : before + number]

    def test_1_nothing_is_sent_while_the_position_is_provisional_and_this_is_told(self) -> None:
        self.diagnostics.wait_for("autopilot_link", "positions withheld", 5)
        self.assertEqual(self.peer.of_type("ODOMETRY"), [])
        wait_until(lambda: self.diagnostics.values("autopilot_link")["sent now"] == "position provisional")

    def test_2_a_good_position_comes_with_the_autopilots_own_depth_heading_and_time(self) -> None:
        type(self).state = PositionStatus.GOOD
        got = self._next(20)
        np.testing.assert_allclose([got[-1].x, got[-1].y, got[-1].z], [0.0, 3.0, DEPTH], atol=1e-3)
        turn = [math.cos(HEADING / 2.0), 0.0, 0.0, math.sin(HEADING / 2.0)]
        np.testing.assert_allclose(got[-1].q, turn, atol=1e-5)
        self.assertAlmostEqual(got[-1].pose_covariance[0], 0.04, places=6)
        # Not more often than ten times a second, at stamps of the headings.
        times = np.array([message.time_usec for message in got]) * 1e-6
        self.assertGreaterEqual(np.diff(times).mean(), 0.095)
        # A slow machine delivers late, but a wrong clock is off by more.
        self.assertLess(abs(self.peer.now_ns() * 1e-9 - times[-1]), 60.0)

    def test_3_a_fix_far_away_is_a_jump(self) -> None:
        before = self._next()[0]
        fix = PoseWithCovarianceStamped()
        fix.header.frame_id, fix.pose.pose.orientation.w = "map", 1.0
        fix.header.stamp = rospy.Time.now() - rospy.Duration(1.0)
        fix.pose.pose.position.x = 13.0
        self.fixes.publish(fix)
        wait_until(lambda: self._next()[0].reset_counter == before.reset_counter + 1)
        self.assertAlmostEqual(self._next()[0].y, 13.0, delta=0.1)
        type(self).x = 13.0

    def test_4_nothing_is_sent_of_a_doubtful_position_and_again_when_it_is_good(self) -> None:
        type(self).state = PositionStatus.DOUBTFUL
        wait_until(lambda: self.diagnostics.values("autopilot_link")["sent now"] == "position provisional")
        sent = self.diagnostics.known("autopilot_link", "positions sent")
        withheld = self.diagnostics.known("autopilot_link", "positions withheld")
        self.diagnostics.wait_for("autopilot_link", "positions withheld", withheld + 5)
        self.assertEqual(self.diagnostics.known("autopilot_link", "positions sent"), sent)
        type(self).state = PositionStatus.GOOD
        self._next()


if __name__ == "__main__":
    run(AutopilotLink)
