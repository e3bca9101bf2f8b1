#!/usr/bin/env python3
"""A tour on the chart, broken seven times: mlsm_core goes on, names what happened, and tells how uncertain it is."""

import unittest
from typing import List

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from graph import Diagnostics, Inbox, publisher, run, wait_until
from messages import place, still_echoes, transform, variance
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import NavSatFix, NavSatStatus
from std_msgs.msg import Float64MultiArray
from tf2_msgs.msg import TFMessage

from georeferencing.origin import Origin
from mlsm_manager.localisation.parameters import MlsmCoreParameters
from node_support.geometry import composed, inverse, transformed
from underwater_map_construction.msg import PositionStatus, StampedIntensityCloud

TURN, STEP, TICK = 16.0, 1.0, 0.1  # s
SIDES = [((-12, 12), (14, 12)), ((14, 12), (14, -10)), ((14, -10), (-12, -10)), ((-12, -10), (-12, 12))]
WALLS = np.vstack([np.linspace(*ends, 40, endpoint=False) for ends in np.array(SIDES, dtype=float)])
HOUR = 3600.0
ORIGIN = Origin(41.2, 3.1)
COVERS = 2.5  # deviations
LEAST = 0.3  # m: what echoes of half a metre tell


class Trust(unittest.TestCase):
    """Sends odometry and echoes of a vehicle that goes round in a basin, and the clock with them."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.seconds, cls.shift, cls.offset = 0.0, 1000.0, np.zeros(3)
        cls.strangers: List[str] = []
        cls.fixes = Inbox("/MLSM/pose", PoseWithCovarianceStamped).linked()
        cls.now = Inbox("/MLSM/pose_now", PoseWithCovarianceStamped).linked()
        cls.corrections = Inbox("/tf", TFMessage, lambda sent: sent.transforms[0].header.frame_id == "map").linked()
        cls.status, cls.diagnostics = Inbox("/MLSM/status", PositionStatus).linked(), Diagnostics()
        cls.clock, cls.tf = publisher("/clock", Clock), publisher("/tf", TFMessage, 2)
        cls.echoes = publisher("/sonar/scan/echoes", StampedIntensityCloud)
        cls.charted = Inbox("/MLSM/navsat", NavSatFix).linked()
        cls.origins = Inbox("/MLSM/origin", Float64MultiArray)
        cls.satellites = publisher("/fix", NavSatFix)
        cls.seen = publisher("/initialpose", PoseWithCovarianceStamped)
        cls.first_status = cls.status.wait_for()
        cls.send_odometry()
        for _ in range(2):
            cls.turn_of_the_head()
        cls.fixes.wait_for_number(1)
        for _ in range(4):
            cls.turn_of_the_head()

    def test_the_status_is_told_before_any_odometry(self) -> None:
        self.assertEqual((self.first_status.state, self.first_status.text), (PositionStatus.UNKNOWN, "no position yet"))

    def test_0_fixes_of_satellites_put_the_vehicle_on_the_chart(self) -> None:
        for is_late in (False, True):
            x, y, _ = truth(self.seconds)
            fix = NavSatFix(latitude=ORIGIN.degrees([[x, y]])[0, 0], longitude=ORIGIN.degrees([[x, y]])[0, 1])
            fix.header.stamp = rospy.Time.from_sec(self.stamp())
            fix.status.status = NavSatStatus.STATUS_NO_FIX if is_late else NavSatStatus.STATUS_FIX
            fix.latitude += 1.0 * is_late
            self.satellites.publish(fix)
        self.diagnostics.wait_for("mlsm_core", "satellite fixes without a position", 1)
        self.turn_of_the_head()
        told = self.charted.wait_for(lambda one: one.header.stamp.to_sec() > self.stamp() - 2.0 * STEP)
        off = ORIGIN.points([[told.latitude, told.longitude]])[0] - truth(self.seconds)[:2]
        # The receiver did not tell its accuracy: 3 m in each axis, and three degrees of the compass.
        self.assertLess(np.hypot(*off), 1.5)
        sent = Origin.of_array(np.array(self.origins.wait_for().data))
        self.assertLess(np.hypot(*ORIGIN.points([[sent.latitude_deg, sent.longitude_deg]])[0]), 1.5)
        self.assertTrue(8.0 < told.position_covariance[0] < 25.0, told.position_covariance)

    def test_1_a_jump_of_the_odometry_is_left_out_and_named(self) -> None:
        type(self).offset = np.array([30.0, 5.0, 0.0])
        self.assert_goes_on()
        self.assert_said("odometry jumped by 30.")

    def test_2_an_odometry_that_starts_again_from_zero_is_followed_and_named(self) -> None:
        type(self).offset = inverse(truth(self.seconds))
        self.assert_goes_on()
        self.assert_said("odometry started again from zero")

    def test_3_a_second_parent_in_tf_is_refused(self) -> None:
        type(self).strangers = ["elsewhere"]
        self.assert_goes_on()
        type(self).strangers = []
        self.diagnostics.wait_for("mlsm_core", "transforms of a second parent", 1)

    def test_4_a_clock_that_jumps_leaves_the_vehicle_where_it_is(self) -> None:
        """Only a clock jumps where the odometry says the same place just after it."""
        for number, shift in enumerate((HOUR, -HOUR), start=1):
            type(self).shift += shift
            self.stand_until("jumps in time", number)
            self.assert_goes_on()

    def test_5_a_clock_that_stands_while_the_vehicle_goes_on_is_named_and_the_path_goes_on(self) -> None:
        """First it goes on from where it stood, then it jumps ahead to the true time."""
        for number, lost in enumerate((12.0, 0.0), start=1):
            for _ in range(12):
                type(self).seconds += STEP
                type(self).shift -= STEP
                self.tf.publish(TFMessage([self.odometry()]))
            self.diagnostics.wait_for("mlsm_core", "clocks that stood while the vehicle moved", number)
            type(self).shift += 12.0 - lost
            self.assert_goes_on()

    def test_6_a_place_that_somebody_points_at_is_searched(self) -> None:
        """They point .7 m beside it."""
        pose = PoseWithCovarianceStamped()
        pose.header.frame_id = "map"
        x, y, yaw = truth(self.seconds)
        pose.pose.pose.position.x, pose.pose.pose.position.y = x + 0.5, y - 0.5
        pose.pose.pose.orientation.z, pose.pose.pose.orientation.w = np.sin(yaw / 2.0), np.cos(yaw / 2.0)
        pose.pose.covariance = np.diag([0.25, 0.25, 0.01, 0.01, 0.01, 0.07]).ravel().tolist()
        self.seen.publish(pose)
        self.status.wait_for(lambda found: found.text.startswith("no position yet"))
        self.assert_goes_on()

    def test_7_a_sonar_that_falls_silent_is_named_while_the_position_grows_uncertain(self) -> None:
        before = self.now.wait_for()
        for _ in range(round(4.0 * TURN / STEP)):
            self.send_odometry()
        self.assert_said("sonar silent for ")
        late = self.now.wait_for(lambda pose: pose.header.stamp.to_sec() > before.header.stamp.to_sec() + 3.0 * TURN)
        self.assertGreater(variance(late), variance(before))
        self.assertGreater(float(self.diagnostics.values("mlsm_core")["age of the newest fix [s]"]), 3.0 * TURN)

    def assert_goes_on(self) -> None:
        """After three turns of the head the fix is where the vehicle is, within what is told."""
        for _ in range(3):
            self.turn_of_the_head()
        fix = self.fixes.wait_for(lambda pose: pose.header.stamp.to_sec() > self.stamp() - 2.0 * STEP)
        error = np.hypot(*(place(fix) - truth(fix.header.stamp.to_sec() - self.shift)[:2]))
        self.assertLess(error, max(COVERS * np.sqrt(variance(fix)), LEAST))
        self.assertLess(error, 1.5)

    def stand_until(self, counter: str, number: int) -> None:
        """Let the vehicle stand, while its clock and odometry go on as at sea, until mlsm_core has counted so many."""

        def reached() -> bool:
            type(self).shift += TICK
            self.tf.publish(TFMessage([self.odometry()]))
            self.clock.publish(Clock(rospy.Time.from_sec(self.stamp())))
            return self.diagnostics.reaches("mlsm_core", counter, number, TICK)

        wait_until(reached, told=f"{counter}: not {number}")

    def assert_said(self, text: str) -> None:
        self.status.wait_for(lambda found: text in found.text and found.state != PositionStatus.GOOD)

    @classmethod
    def turn_of_the_head(cls) -> None:
        """Send the odometry of a turn, and then its echoes; wait until they are matched."""
        start, known = cls.seconds, len(cls.fixes.messages)
        while cls.seconds < start + TURN:
            cls.send_odometry()
        cls.echoes.publish(cls.scan(start))
        # Odometry goes on while the scan is matched, for a little time.
        cls.send_odometry()
        if known:
            cls.fixes.wait_for_number(known + 1)
        else:
            # The first scan of all makes the map and is no fix.
            cls.diagnostics.wait_for("mlsm_core", "scans in", 1)

    @classmethod
    def send_odometry(cls) -> None:
        """Send clock and odometry, and wait until map -> odom follows."""
        cls.seconds += STEP
        strangers = [transform(parent, "base_link", cls.stamp()) for parent in cls.strangers]
        cls.tf.publish(TFMessage([cls.odometry(), *strangers]))
        # Clock and odometry come on two connections: while the first ticks are answered, the odometry arrives, too.
        for seconds in cls.stamp() - STEP * np.array([0.75, 0.5, 0.25, 0.0]):
            cls.clock.publish(Clock(rospy.Time.from_sec(seconds)))
            sent = seconds + MlsmCoreParameters.transform_tolerance
            cls.corrections.wait_for(lambda found, sent=sent: abs(stamp_of(found) - sent) < 1e-3)

    @classmethod
    def odometry(cls) -> TransformStamped:
        return transform("odom", "base_link", cls.stamp(), *composed(cls.offset, truth(cls.seconds)))

    @classmethod
    def stamp(cls) -> float:
        return cls.shift + cls.seconds

    @classmethod
    def scan(cls, start: float) -> StampedIntensityCloud:
        """Return the echoes of all walls in odom, each where the odometry puts it at its time."""
        middle = truth(start + TURN / 2.0)
        walls = WALLS[np.argsort(np.arctan2(*(WALLS - middle[:2]).T[::-1]))]
        return still_echoes(transformed(cls.offset, walls), cls.shift + start + np.linspace(0.0, TURN, len(walls)))


def stamp_of(message: TFMessage) -> float:
    """Return the stamp of its first transform, s."""
    return message.transforms[0].header.stamp.to_sec()


def truth(seconds: float) -> np.ndarray:
    """Return T_map_base (3,) of a vehicle that goes round at .4 m/s."""
    angle = 0.4 / 6.0 * seconds
    return np.array([6.0 * np.sin(angle), 6.0 - 6.0 * np.cos(angle) - 5.0, angle])


if __name__ == "__main__":
    run(Trust)
