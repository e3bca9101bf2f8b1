#!/usr/bin/env python3
"""A vehicle without a DVL gets its odom -> base_link from heading, depth and the velocity that the scans tell."""

import math
import unittest

import rospy
from geometry_msgs.msg import Quaternion, Twist, TwistWithCovarianceStamped, Vector3
from graph import Diagnostics, Inbox, publisher, run, wait_until
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64
from tf2_msgs.msg import TFMessage

RATE = 10


class DeadReckoning(unittest.TestCase):
    """Messages are stamped around now, each test a minute after the one before."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.diagnostics = Diagnostics("/dead_reckoning")
        cls.odometry, cls.transforms = Inbox("/odom", Odometry).linked(), Inbox("/tf", TFMessage).linked()
        cls.headings = publisher("/imu", Imu, listeners=2)
        cls.depths = publisher("/depth", Float64)
        cls.velocities = publisher("/MLSM/odometry", Odometry)
        cls.now = rospy.Time.now()

    def setUp(self) -> None:
        type(self).now += rospy.Duration(60.0)

    def _go(self, seconds: float, yaw: float) -> Odometry:
        """Send the headings of some seconds and return the odometry at the last of them."""
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
        type(self).now += rospy.Duration(1.0 / RATE)
        end = self._go(10.0 - 1.0 / RATE, math.pi / 2.0)
        position = end.pose.pose.position
        self.assertAlmostEqual(position.x - start.x, 0.0, places=3)
        self.assertAlmostEqual(position.y - start.y, 5.0, places=3)
        self.assertAlmostEqual(position.z, -3.0, places=6)
        self.assertAlmostEqual(end.twist.twist.linear.x, 0.5)
        self.assertAlmostEqual(_yaw(end), math.pi / 2.0, places=6)

    def test_2_tf_says_the_same_as_the_odometry(self) -> None:
        end = self._go(1.0, 0.3)
        newest = self.transforms.wait_for(lambda message: message.transforms[0].header.stamp == end.header.stamp)
        transform = newest.transforms[0]
        self.assertEqual((transform.header.frame_id, transform.child_frame_id), ("odom", "base_link"))
        self.assertAlmostEqual(transform.transform.translation.x, end.pose.pose.position.x, places=6)

    def test_3_headings_that_nobody_can_use_are_counted_and_the_next_one_is_taken(self) -> None:
        absent = _heading(self.now, 0.0)
        absent.orientation_covariance[0] = -1.0
        late = _heading(rospy.Time(2**32 - 1, 0), 0.0)
        for message in (absent, _heading(self.now, math.nan), late):
            self.headings.publish(message)
        self.diagnostics.wait_for("dead_reckoning", "headings refused", 2)
        self.diagnostics.wait_for("dead_reckoning", "stamps refused", 1)
        self.assertNotIn("internal errors", self.diagnostics.values("dead_reckoning"))
        self._go(1.0, 0.0)

    def test_4_a_compass_that_tf_does_not_know_is_taken_as_aligned_and_said(self) -> None:
        message = _heading(self.now, 0.0)
        message.header.frame_id = "unknown_compass"
        self.headings.publish(message)
        odometry = self.odometry.wait_for(lambda odometry: odometry.header.stamp == self.now)
        self.assertAlmostEqual(_yaw(odometry), 2.0 * math.atan2(message.orientation.z, message.orientation.w), places=6)
        self.diagnostics.wait_for("dead_reckoning", "instruments without a mount", 1)

    def test_5_a_compass_that_publishes_degrees_counts_clockwise_from_north(self) -> None:
        """What is no heading is left out, and the next one is taken."""
        odometry, headings = Inbox("/level/odom", Odometry).linked(), publisher("/level/compass", Float64)
        for heading in (math.nan, 135.0):
            headings.publish(Float64(data=heading))
        self.assertAlmostEqual(_yaw(odometry.wait_for()), -math.pi / 4.0, places=6)

    def test_6_a_vehicle_that_measures_no_velocity_goes_as_it_is_commanded(self) -> None:
        odometry, headings = Inbox("/level/odom", Odometry).linked(), publisher("/level/compass", Float64)
        commands = publisher("/cmd_vel", Twist)

        def has_moved() -> bool:
            commands.publish(Twist(linear=Vector3(0.5, 0.0, 0.0)))
            headings.publish(Float64(data=0.0))
            return bool(odometry.messages) and odometry.messages[-1].pose.pose.position.y > 0.1

        wait_until(has_moved)
        self.assertEqual(odometry.messages[-1].twist.twist.linear.x, 0.5)

    def test_7_what_a_dvl_measures_moves_another_vehicle_along_its_heading(self) -> None:
        """0.5 m/s to the right for 2 s, heading east, are 1 m to the south."""
        odometry, velocities = Inbox("/dvl/odom", Odometry).linked(), publisher("/dvl", TwistWithCovarianceStamped)
        velocity = TwistWithCovarianceStamped()
        velocity.header.stamp, velocity.header.frame_id = self.now, "base_link"
        velocity.twist.twist.linear.y = -0.5
        velocities.publish(velocity)
        Diagnostics("/dvl_reckoning").wait_for("dead_reckoning", "velocities in", 1)
        places = []
        for moment in (self.now, self.now + rospy.Duration(2.0)):
            self.headings.publish(_heading(moment, 0.0))
            found = odometry.wait_for(lambda message, moment=moment: message.header.stamp == moment)
            places.append(found.pose.pose.position)
        self.assertAlmostEqual(places[1].x - places[0].x, 0.0, places=6)
        self.assertAlmostEqual(places[1].y - places[0].y, -1.0, places=6)


def _heading(stamp: rospy.Time, yaw: float) -> Imu:
    """Return what the compass says when the vehicle's heading is `yaw`."""
    own = yaw + math.pi / 2.0
    message = Imu(orientation=Quaternion(z=math.sin(own / 2.0), w=math.cos(own / 2.0)))
    message.header.stamp, message.header.frame_id = stamp, "compass"
    return message


def _yaw(odometry: Odometry) -> float:
    orientation = odometry.pose.pose.orientation
    return 2.0 * math.atan2(orientation.z, orientation.w)


if __name__ == "__main__":
    run(DeadReckoning)
