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
    "max_range": 20,
    "direction": "clockwise",
    "train_angle_deg": 0,
    "sector_width_deg": 360,
    "data_points": 500,
    "inverted": False,
}
STEP = math.radians(3.0)
WALL = 4.0


class TestDriver(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.client = Client("imagenex_852_driver", timeout=PATIENCE)
        rospy.wait_for_service("imagenex_852_emulator/order_fault", PATIENCE)
        cls.order_fault = rospy.ServiceProxy("imagenex_852_emulator/order_fault", OrderFault)

    def setUp(self):
        self.client.update_configuration(DEFAULTS)
        self.beams = beams()
        self.beams.wait_for_more(2)

    def wait_for_beam(self, wanted):
        assert self.beams.wait(lambda received: wanted(received[-1]))
        return self.beams.received[-1]

    def test_a_full_turn_has_a_beam_at_every_step_clockwise(self):
        angles = np.unwrap([beam.angle for beam in self.beams.wait_for_more(121)])
        np.testing.assert_allclose(np.diff(angles), -STEP, atol=1e-5)

    def test_every_beam_of_a_turn_sees_its_wall(self):
        for beam in self.beams.wait_for_more(120):
            wall = WALL / max(abs(math.cos(beam.angle)), abs(math.sin(beam.angle)))
            strengths = np.frombuffer(beam.intensities, dtype=np.uint8)
            seen = (np.argmax(strengths) + 0.5) * beam.range_resolution
            assert abs(seen - wall) < 2 * beam.range_resolution

    def test_a_beam_says_how_it_was_made(self):
        beam = self.beams.wait_for_more(1)[0]
        made = (beam.header.frame_id, beam.maxrange_meters, len(beam.intensities), beam.gain)
        assert made == ("sonar", 20.0, 500, 20)
        assert abs(beam.range_resolution - 0.04) < 1e-6

    def test_stamps_grow_and_are_of_now(self):
        stamps = [beam.header.stamp.to_sec() for beam in self.beams.wait_for_more(20)]
        assert np.all(np.diff(stamps) > 0)
        assert abs(rospy.get_time() - stamps[-1]) < 2.0

    def test_an_accepted_change_reaches_the_head(self):
        self.client.update_configuration({"max_range": 10, "data_points": 250})
        beam = self.wait_for_beam(lambda beam: beam.maxrange_meters == 10.0)
        assert len(beam.intensities) == 252

    def test_a_reversed_head_turns_counter_clockwise(self):
        self.client.update_configuration({"direction": "counterclockwise"})
        # The ping after the change may still have been on its way.
        angles = np.unwrap([beam.angle for beam in self.beams.wait_for_more(12)[2:]])
        np.testing.assert_allclose(np.diff(angles), STEP, atol=1e-5)

    def test_an_inverted_head_is_mirrored(self):
        self.client.update_configuration({"inverted": True})
        angles = np.unwrap([beam.angle for beam in self.beams.wait_for_more(12)[2:]])
        np.testing.assert_allclose(np.diff(angles), STEP, atol=1e-5)

    def test_refused_changes_leave_everything_as_it_was(self):
        for bad in ({"max_range": 25}, {"train_angle_deg": 60}, {"data_points": 300}, {"max_range": 1000}):
            config = self.client.update_configuration(bad)
            assert {name: config[name] for name in bad} == {name: DEFAULTS[name] for name in bad}
        assert self.beams.wait_for_more(2)[-1].maxrange_meters == 20.0

    def test_the_tilt_of_the_head_is_that_of_its_joint(self):
        joints = rospy.Publisher("joint_states", JointState, queue_size=1, latch=True)
        joints.publish(JointState(name=["rudder", "sonar_tilt"], position=[1.0, 0.3]))
        assert abs(self.wait_for_beam(lambda beam: beam.sensorAngle != 0.0).sensorAngle - 0.3) < 1e-6

    def test_scanning_goes_on_when_the_port_returns(self):
        health = diagnostics()
        absence = rospy.get_param("imagenex_852_emulator/absence_duration")
        last = self.beams.wait_for_more(1)[0].header.stamp.to_sec()
        assert self.order_fault("disappearance", 1).success
        assert health.wait(lambda arrays: bool(arrays) and level(arrays[-1]) == ERROR)
        self.wait_for_beam(lambda beam: beam.header.stamp.to_sec() > last + absence)
        gap = max(np.diff([beam.header.stamp.to_sec() for beam in self.beams.received]))
        print(f"port gone for {absence:g} s, {gap - absence:.2f} s from its return to the next beam")
        assert gap > absence
        assert gap < absence + 2.0
        assert health.wait(lambda arrays: values(arrays[-1])["connected"] == "true")

    def test_an_unknown_fault_is_refused(self):
        answer = self.order_fault("explosion", 1)
        assert not answer.success
        assert "explosion" in answer.message

    def test_a_second_driver_on_the_port_ends_with_one_line(self):
        lines = self.start_driver(f"_port:={rospy.get_param('~port')}")
        assert len(lines) == 1
        assert "in use by another program" in lines[0]

    def test_a_bad_parameter_ends_the_driver_with_one_line(self):
        lines = self.start_driver("_max_range:=25")
        assert len(lines) == 1
        assert "max_range = 25: must be one of 5, 10, 20, 30, 40, 50" in lines[0]

    def start_driver(self, argument):
        """Run a second driver until it ends with status 1; return the lines it printed."""
        command = ["rosrun", PACKAGE, "imagenex_852_driver", "__name:=second_driver", argument]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=PATIENCE)
        rospy.delete_param("second_driver")
        assert done.returncode == 1, done.stdout
        return done.stdout.splitlines()


if __name__ == "__main__":
    rospy.init_node("imagenex_852_driver_test")
    rostest.rosrun(PACKAGE, "imagenex_852_driver_test", TestDriver)
