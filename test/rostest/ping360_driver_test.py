#!/usr/bin/env python3
import math
import subprocess
import unittest

import numpy as np
import rospy
import rostest
from driver_listener import ERROR, PATIENCE, beams, diagnostics, level, values
from dynamic_reconfigure.client import Client
from sensor_msgs.msg import JointState

from underwater_map_construction.srv import OrderFault

PACKAGE = "underwater_map_construction"
DEFAULTS = {
    "max_range": 8.0,
    "data_points": 400,
    "gain_setting": 1,
    "sector_width_deg": 360.0,
    "step_gradians": 4,
    "scan_mode": "auto_transmit",
    "speed_of_sound": 1500.0,
    "inverted": False,
}
GRADIAN = math.radians(0.9)
WALL = 4.0


class TestDriver(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.client = Client("ping360_driver", timeout=PATIENCE)
        rospy.wait_for_service("ping360_emulator/order_fault", PATIENCE)
        cls.order_fault = rospy.ServiceProxy("ping360_emulator/order_fault", OrderFault)

    def setUp(self):
        self.client.update_configuration(DEFAULTS)
        self.beams = beams()
        self.wait_for_beam(lambda beam: len(beam.intensities) == 400 and beam.gain == 1)

    def wait_for_beam(self, wanted):
        assert self.beams.wait(lambda received: bool(received) and wanted(received[-1]))
        return self.beams.received[-1]

    def test_a_full_turn_has_a_beam_at_every_step_clockwise(self):
        angles = np.unwrap([beam.angle for beam in self.beams.wait_for_more(101)])
        np.testing.assert_allclose(np.diff(angles), -4 * GRADIAN, atol=1e-5)

    def test_every_beam_of_a_turn_sees_its_wall(self):
        for beam in self.beams.wait_for_more(100):
            wall = WALL / max(abs(math.cos(beam.angle)), abs(math.sin(beam.angle)))
            strengths = np.frombuffer(beam.intensities, dtype=np.uint8)
            seen = (np.argmax(strengths) + 0.5) * beam.range_resolution
            assert abs(seen - wall) < 2 * beam.range_resolution

    def test_a_beam_says_how_it_was_made(self):
        beam = self.beams.wait_for_more(1)[0]
        assert (beam.header.frame_id, len(beam.intensities), beam.gain) == ("sonar", 400, 1)
        assert abs(beam.maxrange_meters - 8.0) < 0.05
        assert abs(beam.range_resolution - beam.maxrange_meters / 400) < 1e-6

    def test_stamps_grow_and_are_of_now(self):
        stamps = [beam.header.stamp.to_sec() for beam in self.beams.wait_for_more(20)]
        assert np.all(np.diff(stamps) > 0)
        assert abs(rospy.get_time() - stamps[-1]) < 2.0

    def test_accepted_changes_reach_the_head(self):
        self.client.update_configuration({"max_range": 2.0, "gain_setting": 2, "sector_width_deg": 18.0})
        beam = self.wait_for_beam(lambda beam: abs(beam.maxrange_meters - 2.0) < 0.02)
        assert beam.gain == 2
        assert all(abs(beam.angle) < 10.5 * GRADIAN for beam in self.beams.wait_for_more(20)[4:])

    def test_a_slower_sound_shortens_the_bins_of_the_same_time(self):
        self.client.update_configuration({"speed_of_sound": 1400.0})
        period = DEFAULTS["max_range"] / 400 / 1500.0
        self.wait_for_beam(lambda beam: abs(beam.range_resolution / 1400.0 - period * 1500 / 1400) < 1e-8)

    def test_request_mode_scans_too(self):
        health = diagnostics("ping360_driver")
        self.client.update_configuration({"scan_mode": "request"})
        assert health.wait(lambda arrays: bool(arrays) and values(arrays[-1])["scan mode"] == "request")
        self.beams.wait_for_more(5)

    def test_an_inverted_head_is_mirrored(self):
        self.client.update_configuration({"inverted": True})
        angles = np.unwrap([beam.angle for beam in self.beams.wait_for_more(12)[2:]])
        np.testing.assert_allclose(np.diff(angles), 4 * GRADIAN, atol=1e-5)

    def test_refused_changes_leave_everything_as_it_was(self):
        for bad in ({"max_range": 0.5}, {"transmit_duration_us": 3}, {"gain_setting": 3}):
            config = self.client.update_configuration(bad)
            assert all(config[name] != value for name, value in bad.items())
        assert abs(self.beams.wait_for_more(2)[-1].maxrange_meters - 8.0) < 0.05

    def test_the_pulse_is_told_as_the_head_made_it(self):
        told = values(diagnostics("ping360_driver").wait_for_more(2)[-1])
        assert (told["firmware"], told["samples"], told["transmit duration [us]"]) == ("3.3.1", "400", "67")
        assert told["sample period [us]"] == "26.675"

    def test_the_tilt_of_the_head_is_that_of_its_joint(self):
        joints = rospy.Publisher("joint_states", JointState, queue_size=1, latch=True)
        joints.publish(JointState(name=["rudder", "sonar_tilt"], position=[1.0, 0.3]))
        assert abs(self.wait_for_beam(lambda beam: beam.sensorAngle != 0.0).sensorAngle - 0.3) < 1e-6

    def test_scanning_goes_on_when_the_port_returns(self):
        health = diagnostics("ping360_driver")
        absence = rospy.get_param("ping360_emulator/absence_duration")
        last = self.beams.wait_for_more(1)[0].header.stamp.to_sec()
        assert self.order_fault("disappearance", 1).success
        assert health.wait(lambda arrays: bool(arrays) and level(arrays[-1]) == ERROR)
        self.wait_for_beam(lambda beam: beam.header.stamp.to_sec() > last + absence)
        gap = max(np.diff([beam.header.stamp.to_sec() for beam in self.beams.received]))
        print(f"port gone for {absence:g} s, {gap - absence:.2f} s from its return to the next beam")
        assert gap > absence
        assert gap < absence + 2.0
        assert health.wait(lambda arrays: values(arrays[-1])["connected"] == "true")

    def test_a_fault_of_another_sonar_is_refused(self):
        answer = self.order_fault("overrun", 1)
        assert not answer.success
        assert "must be one of none, dropped" in answer.message

    def test_a_bad_parameter_ends_the_driver_with_one_line(self):
        lines = self.start_driver("_max_range:=0.5")
        assert len(lines) == 1
        assert "max_range = 0.5: must be a number from 0.75 to 50 m" in lines[0]

    def test_a_port_that_is_no_address_ends_the_driver_with_one_line(self):
        lines = self.start_driver("_port:=udp://nowhere")
        assert len(lines) == 1
        assert "must be udp://HOST:PORT" in lines[0]

    def start_driver(self, argument):
        """Run a second driver until it ends with status 1; return the lines it printed."""
        command = ["rosrun", PACKAGE, "ping360_driver", "__name:=second_driver", argument]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=PATIENCE)
        rospy.delete_param("second_driver")
        assert done.returncode == 1, done.stdout
        return done.stdout.splitlines()


if __name__ == "__main__":
    rospy.init_node("ping360_driver_test")
    rostest.rosrun(PACKAGE, "ping360_driver_test", TestDriver)
