#!/usr/bin/env python3
"""What a driver does with an emulated head in a square basin. The argument is the sonar."""

import math
import sys
import unittest
from typing import Any, Callable, ClassVar, Dict, List, Tuple

import numpy as np
import rospy
from driver_listener import ERROR, beams, diagnostics, level, values
from dynamic_reconfigure.client import Client
from graph import PACKAGE_ROOT, PATIENCE, ended, run
from sensor_msgs.msg import JointState

from underwater_map_construction.srv import OrderFault

# A ping that a change has not reached may be on its way, and one more may be ordered.
PINGS_BEFORE_A_CHANGE = 2
WALL = 4.0
"""m from the head to each of the basin's four walls."""
GRADIAN = math.radians(0.9)


class DriverBehaviour:
    """Tests that a unittest.TestCase of one sonar inherits.

    sonar: the nodes' names are those of this sonar. defaults: set before each test. step: rad from beam to beam with
    the defaults. refused: changes that the head cannot do. foreign_fault: what its emulator cannot do, and its answer.
    counted_faults: faults of the head and as what the driver counts them.
    """

    sonar: ClassVar[str]
    defaults: ClassVar[Dict[str, Any]]
    step: ClassVar[float]
    refused: ClassVar[Tuple[Dict[str, Any], ...]]
    foreign_fault: ClassVar[Tuple[str, str]]
    counted_faults: ClassVar[Dict[str, str]]

    @classmethod
    def setUpClass(cls) -> None:
        cls.client = Client(f"{cls.sonar}_driver", timeout=PATIENCE)
        rospy.wait_for_service(f"{cls.sonar}_emulator/order_fault", PATIENCE)
        cls.order_fault = rospy.ServiceProxy(f"{cls.sonar}_emulator/order_fault", OrderFault)

    def setUp(self) -> None:
        self.client.update_configuration(self.defaults)
        self.beams = beams()
        assert self.is_of_defaults(self.fresh_beams(1)[0])

    def is_of_defaults(self, beam: Any) -> bool:
        """Return whether a beam shows that the defaults hold."""
        raise NotImplementedError

    def fresh_beams(self, count: int) -> List[Any]:
        """Return the next `count` beams that know of every change until now.

        Beams and the answer of the service that changed something come on connections of their own: older beams may
        come after the answer.
        """
        now = rospy.Time.now()

        def fresh() -> List[Any]:
            return [beam for beam in self.beams.messages if beam.header.stamp > now][PINGS_BEFORE_A_CHANGE:]

        assert self.beams.wait(lambda _: len(fresh()) >= count), f"no {count} beams after {now.to_sec():.3f}"
        return fresh()[:count]

    def wait_for_beam(self, wanted: Callable[[Any], bool]) -> Any:
        """Return the newest beam once it is as wanted."""
        assert self.beams.wait(lambda received: bool(received) and wanted(received[-1]))
        return self.beams.messages[-1]

    @property
    def beams_per_turn(self) -> int:
        """Number of beams from one direction back to it."""
        return round(2.0 * math.pi / self.step)

    def assert_turns_by(self, step: float) -> None:
        """The head turns by `step` rad from each beam to the next one from now on."""
        angles = np.unwrap([beam.angle for beam in self.fresh_beams(10)])
        np.testing.assert_allclose(np.diff(angles), step, atol=1e-5)

    def test_a_full_turn_has_a_beam_at_every_step_clockwise(self) -> None:
        angles = np.unwrap([beam.angle for beam in self.fresh_beams(self.beams_per_turn + 1)])
        np.testing.assert_allclose(np.diff(angles), -self.step, atol=1e-5)

    def test_every_beam_of_a_turn_sees_its_wall(self) -> None:
        for beam in self.fresh_beams(self.beams_per_turn):
            wall = WALL / max(abs(math.cos(beam.angle)), abs(math.sin(beam.angle)))
            strengths = np.frombuffer(beam.intensities, dtype=np.uint8)
            seen = (np.argmax(strengths) + 0.5) * beam.range_resolution
            assert abs(seen - wall) < 2 * beam.range_resolution

    def test_stamps_grow_and_are_of_now(self) -> None:
        start = rospy.get_time()
        stamps = [beam.header.stamp.to_sec() for beam in self.fresh_beams(20)]
        assert np.all(np.diff(stamps) > 0)
        assert start < stamps[0]
        assert stamps[-1] < rospy.get_time()

    def test_an_inverted_head_is_mirrored(self) -> None:
        self.client.update_configuration({"inverted": True})
        self.assert_turns_by(self.step)

    def test_the_tilt_of_the_head_is_that_of_its_joint(self) -> None:
        joints = rospy.Publisher("joint_states", JointState, queue_size=1, latch=True)
        joints.publish(JointState(name=["rudder", "sonar_tilt"], position=[1.0, 0.3]))
        assert abs(self.wait_for_beam(lambda beam: beam.sensorAngle != 0.0).sensorAngle - 0.3) < 1e-6

    def test_scanning_goes_on_when_the_port_returns(self) -> None:
        """Until then the diagnostics report an error; how soon it goes on is shown in virtual time by unit tests."""
        health = diagnostics(f"{self.sonar}_driver")
        absence = rospy.get_param(f"{self.sonar}_emulator/absence_duration")
        last = self.beams.wait_for_more(1)[0].header.stamp.to_sec()
        assert self.order_fault("disappearance", 1).success
        assert health.wait(lambda arrays: any(level(array) == ERROR for array in arrays))
        self.wait_for_beam(lambda beam: beam.header.stamp.to_sec() > last + absence)
        gap = max(np.diff([beam.header.stamp.to_sec() for beam in self.beams.messages]))
        print(f"port gone for {absence:g} s, {gap - absence:.2f} s from its return to the next beam")
        assert gap > absence
        assert health.wait(lambda arrays: values(arrays[-1])["connected"] == "true")

    def test_faults_of_the_head_are_counted_and_the_scan_goes_on(self) -> None:
        health = diagnostics(f"{self.sonar}_driver")
        before = values(health.wait_for_more(1)[0])
        for fault in self.counted_faults:
            assert self.order_fault(fault, 1).success
        for count in self.counted_faults.values():
            wanted = int(before.get(count, 0)) + 1
            assert health.wait(lambda arrays, w=wanted, c=count: int(values(arrays[-1]).get(c, 0)) >= w), count
        self.fresh_beams(3)

    def test_refused_changes_leave_everything_as_it_was(self) -> None:
        for bad in self.refused:
            before = self.client.get_configuration(timeout=PATIENCE)
            config = self.client.update_configuration(bad)
            assert {name: config[name] for name in bad} == {name: before[name] for name in bad}
        assert self.is_of_defaults(self.fresh_beams(1)[0])

    def test_a_fault_that_the_head_does_not_know_is_refused(self) -> None:
        name, told = self.foreign_fault
        answer = self.order_fault(name, 1)
        assert not answer.success
        assert told in answer.message


class Imagenex852(DriverBehaviour, unittest.TestCase):
    """With 500 echoes, clockwise."""

    sonar, step = "imagenex_852", math.radians(3.0)
    defaults: ClassVar[Dict[str, Any]] = {
        "max_range": 20, "direction": "clockwise", "train_angle_deg": 0, "sector_width_deg": 360, "data_points": 500,
        "inverted": False,
    }  # fmt: skip
    refused = ({"max_range": 25}, {"train_angle_deg": 60}, {"data_points": 300}, {"max_range": 1000})
    foreign_fault = "explosion", "explosion"
    counted_faults: ClassVar[Dict[str, str]] = {
        "garbled": "bad frames", "doubled": "unexpected replies", "dropped": "timeouts", "overrun": "overruns"
    }  # fmt: skip

    def is_of_defaults(self, beam):
        return beam.maxrange_meters == 20.0

    def test_a_beam_says_how_it_was_made(self):
        beam = self.fresh_beams(1)[0]
        made = (beam.header.frame_id, beam.maxrange_meters, len(beam.intensities), beam.gain)
        assert made == ("sonar", 20.0, 500, 20)
        assert abs(beam.range_resolution - 0.04) < 1e-6

    def test_an_accepted_change_reaches_the_head(self):
        self.client.update_configuration({"max_range": 10, "data_points": 250})
        beam = self.wait_for_beam(lambda beam: beam.maxrange_meters == 10.0)
        assert len(beam.intensities) == 252

    def test_a_second_driver_on_the_port_ends_with_one_line(self):
        command = [str(PACKAGE_ROOT / "nodes/imagenex_852_driver"), "__name:=second_driver"]
        done = ended([*command, f"_port:={rospy.get_param('imagenex_852_driver/port')}"])
        rospy.delete_param("second_driver")
        (line,) = done.stdout.splitlines()
        assert done.returncode == 1
        assert "in use by another program" in line


class Ping360(DriverBehaviour, unittest.TestCase):
    """With 400 samples, scanning by itself."""

    sonar, step = "ping360", 4 * GRADIAN
    defaults: ClassVar[Dict[str, Any]] = {
        "max_range": 8.0, "data_points": 400, "gain_setting": 1, "sector_width_deg": 360.0, "step_gradians": 4,
        "scan_mode": "auto_transmit", "speed_of_sound": 1500.0, "inverted": False,
    }  # fmt: skip
    refused = ({"max_range": 0.5}, {"transmit_duration_us": 3}, {"gain_setting": 3})
    foreign_fault = "overrun", "must be one of none, dropped"
    counted_faults: ClassVar[Dict[str, str]] = {"garbled": "bad frames", "doubled": "unexpected replies"}

    def is_of_defaults(self, beam):
        return len(beam.intensities) == 400 and beam.gain == 1 and abs(beam.maxrange_meters - 8.0) < 0.05

    def test_a_beam_says_how_it_was_made(self):
        beam = self.fresh_beams(1)[0]
        assert beam.header.frame_id == "sonar"
        assert abs(beam.range_resolution - beam.maxrange_meters / 400) < 1e-6

    def test_accepted_changes_reach_the_head(self):
        self.client.update_configuration({"max_range": 2.0, "gain_setting": 2, "sector_width_deg": 18.0})
        beam = self.wait_for_beam(lambda beam: abs(beam.maxrange_meters - 2.0) < 0.02)
        assert beam.gain == 2
        assert all(abs(beam.angle) < 10.5 * GRADIAN for beam in self.fresh_beams(20)[4:])

    def test_the_pulse_is_told_as_the_head_made_it(self):
        told = values(diagnostics("ping360_driver").wait_for_more(2)[-1])
        assert (told["firmware"], told["samples"], told["transmit duration [us]"]) == ("3.3.1", "400", "67")
        assert told["sample period [us]"] == "26.675"


if __name__ == "__main__":
    run({"imagenex_852": Imagenex852, "ping360": Ping360}[sys.argv[1]])
