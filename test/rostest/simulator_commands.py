#!/usr/bin/env python3
"""Velocity commands move the simulated vehicle, bad ones and none do not."""

import math
import signal
import subprocess
import time
import unittest

import rospy
from geometry_msgs.msg import Twist, Vector3
from graph import PACKAGE_ROOT, PATIENCE, Diagnostics, Inbox, publisher, run
from nav_msgs.msg import Odometry
from std_msgs.msg import Header

from underwater_map_construction.msg import StampedIntensityCloud

ATTEMPTS = 5


def _command(surge: float, sway: float = 0.0) -> Twist:
    return Twist(linear=Vector3(surge, sway, 0.0))


def _goes_on_at_speed(truth: Odometry) -> bool:
    """Return whether the vehicle has come so far that it no longer accelerates, and moves as it was told."""
    speed = truth.twist.twist.linear
    return truth.pose.pose.position.x > -1.5 and abs(speed.x - 0.4) < 0.05 and abs(speed.y - 0.1) < 0.02


def _echoes(stamp: rospy.Time) -> StampedIntensityCloud:
    return StampedIntensityCloud(header=Header(stamp=stamp))


class SimulatorCommands(unittest.TestCase):
    """The vehicle starts where the tank's tour does, at (-2.5, 0.6)."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.truth, cls.diagnostics = Inbox("/ground_truth", Odometry), Diagnostics()
        cls.commands = publisher("cmd_vel", Twist)

    def _drive(self, command: Twist, fits: object) -> Odometry:
        """Repeat a command until the truth fits."""
        repeating = rospy.Timer(rospy.Duration(0.1), lambda _: self._command(command))
        try:
            return self.truth.wait_for(fits)
        finally:
            repeating.shutdown()

    def _command(self, command: Twist) -> None:
        type(self).last_command = rospy.Time.now()
        self.commands.publish(command)

    def test_it_follows_commands_and_stops_when_they_cease(self) -> None:
        """Half a second of simulated time after the last command it slows down."""
        self._drive(_command(0.4, 0.1), _goes_on_at_speed)
        still = self.truth.wait_for(lambda m: m.twist.twist.linear.x == 0.0)
        last = next(m for m in reversed(self.truth.messages) if m.header.stamp <= self.last_command)
        self.assertLess((still.header.stamp - last.header.stamp).to_sec(), 8.0)
        self.assertLess(still.pose.pose.position.x - last.pose.pose.position.x, 1.0)

    def test_commands_beyond_its_powers_are_limited_and_senseless_ones_refused(self) -> None:
        self.commands.publish(_command(math.nan))
        fast = self._drive(_command(-9.0), lambda m: m.twist.twist.linear.x < -0.9)
        self.assertGreaterEqual(fast.twist.twist.linear.x, -1.0)
        self.diagnostics.wait_for("sonar_simulator", "velocity commands limited", 1)
        self.diagnostics.wait_for("sonar_simulator", "velocity commands refused", 1)

    def test_time_waits_for_echoes_that_are_overdue(self) -> None:
        """They came each second; two seconds after the last ones time stands, until others come."""
        echoes = publisher("sonar/scan/echoes", StampedIntensityCloud)
        last = rospy.Time.now()
        for seconds in (1.0, 0.0):
            echoes.publish(_echoes(last - rospy.Duration(seconds)))
        held = self._held_time()
        echoes.publish(_echoes(held))
        self.truth.wait_for(lambda m: m.header.stamp > held)
        held = self._held_time()
        echoes.unregister()  # as if their sender had ended
        self.truth.wait_for(lambda m: m.header.stamp > held + rospy.Duration(20.0))
        echoes = publisher("sonar/scan/echoes", StampedIntensityCloud)
        echoes.publish(_echoes(rospy.Time.now()))
        self._held_time()
        echoes.unregister()

    def _held_time(self) -> rospy.Time:
        """Return the time, which must stand for a second, in which four are simulated while nothing is waited for."""
        ends, held = time.monotonic() + PATIENCE, None
        while held != rospy.Time.now():
            self.assertLess(time.monotonic(), ends, "time goes on")
            held = rospy.Time.now()
            time.sleep(1.0)
        return held

    def test_it_ends_within_two_seconds_of_ctrl_c(self) -> None:
        """Also when its next moment is five seconds away; another program may take the processor in one attempt.

        It then does not say that its moves have ended.
        """
        self.assertTrue(any(self._seconds_to_end() < 2.0 for _ in range(ATTEMPTS)))

    def _seconds_to_end(self) -> float:
        """Return how long a simulator of its own takes to end after Ctrl-C, s."""
        command = [str(PACKAGE_ROOT / "nodes/sonar_simulator"), "__ns:=/other", "_wait_for_listener:=false"]
        others = ["robot_description:=/robot_description", "/clock:=/other_clock", "/tf:=/other_tf"]
        process = subprocess.Popen([*command, "_real_time_factor:=0.01", *others], stdout=subprocess.PIPE, text=True)
        self.addCleanup(process.kill)
        clock = Inbox("/other_clock", rospy.AnyMsg)
        clock.wait_for()
        clock.close()
        start = time.monotonic()
        process.send_signal(signal.SIGINT)
        told, _ = process.communicate(timeout=PATIENCE)
        seconds = time.monotonic() - start
        self.assertNotIn("have ended", told)
        return seconds


if __name__ == "__main__":
    run(SimulatorCommands)
