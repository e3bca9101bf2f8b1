#!/usr/bin/env python3
"""What a driver does with an emulated head in a square basin. The argument is the sonar."""

import math
import sys
import unittest
from typing import Any, Callable, ClassVar, Dict, List, Tuple

import numpy as np
import rospy
from dynamic_reconfigure.client import Client
from graph import PATIENCE, Diagnostics, Inbox, publisher, run, wait_until
from sensor_msgs.msg import JointState

from underwater_map_construction.msg import SonarScanLine
from underwater_map_construction.srv import OrderFault

# A ping that a change has not reached may be on its way, and one more may be ordered.
PINGS_BEFORE_A_CHANGE = 2
WALL = 4.0
"""m from the head to each of the basin's four walls."""
GRADIAN = math.radians(0.9)


class DriverBehaviour:
    """Tests that a unittest.TestCase of one sonar inherits.

    sonar: the nodes' names are those of this sonar. defaults: set before each test. step: rad from beam to beam with
    the defaults. foreign_fault: what its emulator cannot do, and its answer. counted_faults: faults of the head and as
    what the driver counts them.
    """

    sonar: ClassVar[str]
    defaults: ClassVar[Dict[str, Any]]
    step: ClassVar[float]
    foreign_fault: ClassVar[Tuple[str, str]]
    counted_faults: ClassVar[Dict[str, str]]

    @classmethod
    def setUpClass(cls) -> None:
        cls.driver = f"{cls.sonar}_driver"
        cls.client, cls.diagnostics = Client(cls.driver, timeout=PATIENCE), Diagnostics(f"/{cls.driver}")
        rospy.wait_for_service(f"{cls.sonar}_emulator/order_fault", PATIENCE)
        cls.order_fault = rospy.ServiceProxy(f"{cls.sonar}_emulator/order_fault", OrderFault)

    def setUp(self) -> None:
        self.client.update_configuration(self.defaults)
        self.beams = Inbox("sonar/raw", SonarScanLine)

    def fresh_beams(self, count: int) -> List[Any]:
        """Return the next `count` beams that know of every change until now.

        Beams and the answer of the service that changed something come on connections of their own: older beams may
        come after the answer.
        """
        now = rospy.Time.now()

        def fresh() -> List[Any]:
            return [beam for beam in self.beams.messages if beam.header.stamp > now][PINGS_BEFORE_A_CHANGE:]

        self.beams.wait_for(lambda _: len(fresh()) >= count)
        return fresh()[:count]

    def assert_turns_by(self, step: float, beams: List[Any]) -> None:
        """The head turns by `step` rad from each beam to the next one."""
        np.testing.assert_allclose(np.diff(np.unwrap([beam.angle for beam in beams])), step, atol=1e-5)

    def test_every_beam_of_a_turn_clockwise_sees_its_wall(self) -> None:
        start = rospy.get_time()
        beams = self.fresh_beams(round(2.0 * math.pi / self.step) + 1)
        self.assert_turns_by(-self.step, beams)
        for beam in beams:
            wall = WALL / max(abs(math.cos(beam.angle)), abs(math.sin(beam.angle)))
            strengths = np.frombuffer(beam.intensities, dtype=np.uint8)
            seen = (np.argmax(strengths) + 0.5) * beam.range_resolution
            self.assertLess(abs(seen - wall), 2 * beam.range_resolution)
        stamps = [start, *(beam.header.stamp.to_sec() for beam in beams), rospy.get_time()]
        self.assertGreater(np.diff(stamps).min(), 0.0)

    def test_an_inverted_head_is_mirrored(self) -> None:
        self.client.update_configuration({"inverted": True})
        self.assert_turns_by(self.step, self.fresh_beams(10))

    def test_the_tilt_of_the_head_is_that_of_its_joint(self) -> None:
        joints = publisher("joint_states", JointState)
        joints.publish(JointState(name=["rudder", "sonar_tilt"], position=[1.0, 0.3]))
        self.assertAlmostEqual(self.beams.wait_for(lambda beam: beam.sensorAngle != 0.0).sensorAngle, 0.3, places=6)

    def test_scanning_goes_on_when_the_port_returns(self) -> None:
        """How soon it goes on is shown in virtual time by unit tests."""
        absence = rospy.get_param(f"{self.sonar}_emulator/absence_duration")
        last = self.beams.wait_for().header.stamp.to_sec()
        self.assertTrue(self.order_fault("disappearance", 1).success)
        self.wait_until_connected("false")
        self.beams.wait_for(lambda beam: beam.header.stamp.to_sec() > last + absence)
        gap = max(np.diff([beam.header.stamp.to_sec() for beam in self.beams.messages]))
        print(f"port gone for {absence:g} s, {gap - absence:.2f} s from its return to the next beam")
        self.assertGreater(gap, absence)
        self.wait_until_connected("true")

    def wait_until_connected(self, told: str) -> None:
        wait_until(lambda: self.diagnostics.values(self.driver)["connected"] == told, told=f"not connected: {told}")

    def test_faults_of_the_head_are_counted_and_the_scan_goes_on(self) -> None:
        before = {count: self.diagnostics.known(self.driver, count) for count in self.counted_faults.values()}
        for fault in self.counted_faults:
            self.assertTrue(self.order_fault(fault, 1).success)
        for count, number in before.items():
            self.diagnostics.wait_for(self.driver, count, number + 1)
        self.fresh_beams(3)

    def test_a_fault_that_the_head_does_not_know_is_refused(self) -> None:
        name, told = self.foreign_fault
        answer = self.order_fault(name, 1)
        self.assertFalse(answer.success)
        self.assertIn(told, answer.message)

    def changed(self, changes: Dict[str, Any], is_changed: Callable[[Any], bool]) -> Any:
        """Change the configuration, and return a beam that shows it."""
        self.client.update_configuration(changes)
        return self.beams.wait_for(is_changed)


class Imagenex852(DriverBehaviour, unittest.TestCase):
    """With 500 echoes, clockwise."""

    sonar, step = "imagenex_852", math.radians(3.0)
    defaults: ClassVar[Dict[str, Any]] = {"max_range": 20, "direction": "clockwise", "data_points": 500,
                                          "inverted": False}  # fmt: skip
    foreign_fault = "explosion", "explosion"
    counted_faults: ClassVar[Dict[str, str]] = {
        "garbled": "bad frames", "doubled": "unexpected replies", "dropped": "timeouts", "overrun": "overruns"
    }  # fmt: skip

    def test_a_beam_says_how_it_was_made(self):
        beam = self.fresh_beams(1)[0]
        made = (beam.header.frame_id, beam.maxrange_meters, len(beam.intensities), beam.gain)
        self.assertEqual(made, ("sonar", 20.0, 500, 20))
        self.assertAlmostEqual(beam.range_resolution, 0.04, places=6)

    def test_an_accepted_change_reaches_the_head(self):
        beam = self.changed({"max_range": 10, "data_points": 250}, lambda beam: beam.maxrange_meters == 10.0)
        self.assertEqual(len(beam.intensities), 252)


class Ping360(DriverBehaviour, unittest.TestCase):
    """With 400 samples, scanning by itself."""

    sonar, step = "ping360", 4 * GRADIAN
    defaults: ClassVar[Dict[str, Any]] = {
        "max_range": 8.0, "data_points": 400, "gain_setting": 1, "sector_width_deg": 360.0, "step_gradians": 4,
        "scan_mode": "auto_transmit", "speed_of_sound": 1500.0, "inverted": False,
    }  # fmt: skip
    foreign_fault = "overrun", "must be one of none, dropped"
    counted_faults: ClassVar[Dict[str, str]] = {"garbled": "bad frames", "doubled": "unexpected replies"}

    def test_a_beam_says_how_it_was_made(self):
        beam = self.fresh_beams(1)[0]
        self.assertEqual((beam.header.frame_id, len(beam.intensities), beam.gain), ("sonar", 400, 1))
        self.assertAlmostEqual(beam.maxrange_meters, 8.0, delta=0.05)
        self.assertAlmostEqual(beam.range_resolution, beam.maxrange_meters / 400, places=6)

    def test_accepted_changes_reach_the_head(self):
        changes = {"max_range": 2.0, "gain_setting": 2, "sector_width_deg": 18.0}
        beam = self.changed(changes, lambda beam: abs(beam.maxrange_meters - 2.0) < 0.02)
        self.assertEqual(beam.gain, 2)
        self.assertTrue(all(abs(beam.angle) < 10.5 * GRADIAN for beam in self.fresh_beams(20)[4:]))

    def test_the_pulse_is_told_as_the_head_made_it(self):
        told = {"firmware": "3.3.1", "samples": "400", "transmit duration [us]": "67", "sample period [us]": "26.675"}
        wait_until(lambda: told.items() <= self.diagnostics.values(self.driver).items(), told=f"not {told}")


if __name__ == "__main__":
    run({"imagenex_852": Imagenex852, "ping360": Ping360}[sys.argv[1]])
