#!/usr/bin/env python3
"""A vehicle without a DVL gets its odom -> base_link from heading, depth and the velocity that the scans tell."""

import math
import unittest

import rospy
from geometry_msgs.msg import Quaternion, TwistWithCovarianceStamped
from graph import Diagnostics, Inbox, run
from messages import publisher
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64
from tf2_msgs.msg import TFMessage

PACKAGE = "underwater_map_construction"
RATE = 10


class DeadReckoning(unittest.TestCase):
    """Messages are stamped around now, each test a minute after the one before."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.diagnostics = Diagnostics("/dead_reckoning")
        cls.odometry, cls.transforms = Inbox("/odom", Odometry), Inbox("/tf", TFMessage)
        for inbox in (cls.odometry, cls.transforms):
            inbox.wait_for_link()
        cls.headings = publisher("/imu", Imu, listeners=2)
        cls.depths = publisher("/depth", Float64)
        cls.velocities = publisher("/MLSM/odometry", Odometry)
        cls.now = rospy.Time.now()

    def _go(self, seconds: float, yaw: float) -> Odometry:
        """Send the headings of some seconds and return the odometry at the last of them."""
        type(self).now += rospy.Duration(60.0)
        for step in range(round(seconds * RATE) + 1):
            message = _heading(self.now + rospy.Duration(step / RATE), yaw)
            self.headings.publish(message)
        type(self).now = message.header.stamp
        return self.odometry.wait_for(lambda odometry: odometry.header.stamp == message.header.stamp)

    def test_1_the_vehicle_moves_with_its_velocity_along_its_heading(self) -> None:
        """0.5 m/s ahead for 10 s, heading north, are 5 m along y; the compass on the vehicle is turned by 90 deg."""
        self.depths.publish(Float64(data=3.0))
        self.diagnostics.wait_for("dead_reckoning", "depths in", 1)
        start = self._go(0.0, math.pi / 2.0).pose.pose.position
        velocity = Odometry(child_frame_id="base_link")
        velocity.header.stamp, velocity.header.frame_id = self.now, "map"
        velocity.twist.twist.linear.x = 0.5
        self.velocities.publish(velocity)
        self.diagnostics.wait_for("dead_reckoning", "velocities in", 1)
        type(self).now -= rospy.Duration(60.0 - 1.0 / RATE)
        end = self._go(10.0 - 1.0 / RATE, math.pi / 2.0)
        position = end.pose.pose.position
        self.assertAlmostEqual(position.x - start.x, 0.0, places=3)
        self.assertAlmostEqual(position.y - start.y, 5.0, places=3)
        self.assertAlmostEqual(position.z, -3.0, places=6)
        self.assertAlmostEqual(end.twist.twist.linear.x, 0.5)
        self.assertAlmostEqual(_yaw(end.pose.pose.orientation), math.pi / 2.0, places=6)

    def test_2_tf_says_the_same_as_the_odometry(self) -> None:
        end = self._go(1.0, 0.3)
        newest = self.transforms.wait_for(lambda message: message.transforms[0].header.stamp == end.header.stamp)
        transform = newest.transforms[0]
        self.assertEqual((transform.header.frame_id, transform.child_frame_id), ("odom", "base_link"))
        self.assertAlmostEqual(transform.transform.translation.x, end.pose.pose.position.x, places=6)

    def test_3_headings_that_nobody_can_use_are_counted_and_the_next_one_is_taken(self) -> None:
        stamp = self.now + rospy.Duration(61.0)
        empty = Imu(orientation=Quaternion(0.0, 0.0, 0.0, 0.0))
        absent = _heading(stamp, 0.0)
        absent.orientation_covariance[0] = -1.0
        broken = _heading(stamp, math.nan)
        for message in (empty, broken):
            message.header.stamp, message.header.frame_id = stamp, "compass"
        late = _heading(rospy.Time(2**32 - 1, 0), 0.0)
        for message in (empty, absent, broken, late):
            self.headings.publish(message)
        self.diagnostics.wait_for("dead_reckoning", "headings refused", 3)
        self.diagnostics.wait_for("dead_reckoning", "stamps refused", 1)
        self.assertNotIn("internal errors", self.diagnostics.values("dead_reckoning"))
        self._go(1.0, 0.0)

    def test_4_a_compass_that_tf_does_not_know_is_taken_as_aligned_and_said(self) -> None:
        stamp = self.now + rospy.Duration(120.0)
        message = _heading(stamp, 0.0)
        message.header.frame_id = "unknown_compass"
        self.headings.publish(message)
        odometry = self.odometry.wait_for(lambda odometry: odometry.header.stamp == stamp)
        self.assertAlmostEqual(_yaw(odometry.pose.pose.orientation), _yaw(message.orientation), places=6)
        self.diagnostics.wait_for("dead_reckoning", "instruments without a mount", 1)

    def test_5_a_compass_that_publishes_degrees_counts_clockwise_from_north(self) -> None:
        """East is 90 degrees; what is no heading is counted, and the next one is taken."""
        odometry, headings = Inbox("/level/odom", Odometry), publisher("/level/compass", Float64)
        odometry.wait_for_link()
        for heading in (math.nan, 90.0):
            headings.publish(Float64(data=heading))
        east = odometry.wait_for(lambda _: True)
        self.assertAlmostEqual(_yaw(east.pose.pose.orientation), 0.0, places=6)
        headings.publish(Float64(data=135.0))
        south_east = odometry.wait_for(lambda message: message.header.stamp > east.header.stamp)
        self.assertAlmostEqual(_yaw(south_east.pose.pose.orientation), -math.pi / 4.0, places=6)

    def test_6_what_a_dvl_measures_moves_another_vehicle_along_its_heading(self) -> None:
        """0.5 m/s to the right for 2 s, heading east, are 1 m to the south."""
        odometry, velocities = Inbox("/dvl/odom", Odometry), publisher("/dvl", TwistWithCovarianceStamped)
        diagnostics = Diagnostics("/dvl_reckoning")
        odometry.wait_for_link()
        stamp = self.now + rospy.Duration(180.0)
        velocity = TwistWithCovarianceStamped()
        velocity.header.stamp, velocity.header.frame_id = stamp, "base_link"
        velocity.twist.twist.linear.y = -0.5
        velocities.publish(velocity)
        diagnostics.wait_for("dead_reckoning", "velocities in", 1)
        places = []
        for moment in (stamp, stamp + rospy.Duration(2.0)):
            self.headings.publish(_heading(moment, 0.0))
            found = odometry.wait_for(lambda message, moment=moment: message.header.stamp == moment)
            places.append(found.pose.pose.position)
        self.assertAlmostEqual(places[1].x - places[0].x, 0.0, places=6)
        self.assertAlmostEqual(places[1].y - places[0].y, -1.0, places=6)


def _heading(stamp: rospy.Time, yaw: float) -> Imu:
    """Return what the compass says when the vehicle's heading is `yaw`."""
    message = Imu()
    message.header.stamp, message.header.frame_id = stamp, "compass"
    own = yaw + math.pi / 2.0
    message.orientation.z, message.orientation.w = math.sin(own / 2.0), math.cos(own / 2.0)
    return message


def _yaw(orientation: Quaternion) -> float:
    return 2.0 * math.atan2(orientation.z, orientation.w)


if __name__ == "__main__":
    run(DeadReckoning)
