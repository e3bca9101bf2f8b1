#!/usr/bin/env python3
import math
import unittest

import rospy
from driver_behaviour import DriverBehaviour
from graph import run

DEFAULTS = {
    "max_range": 20,
    "direction": "clockwise",
    "train_angle_deg": 0,
    "sector_width_deg": 360,
    "data_points": 500,
    "inverted": False,
}


class TestDriver(DriverBehaviour, unittest.TestCase):
    sonar, defaults, wall, step = "imagenex_852", DEFAULTS, 4.0, math.radians(3.0)

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

    def test_a_reversed_head_turns_counter_clockwise(self):
        self.client.update_configuration({"direction": "counterclockwise"})
        self.assert_turns_by(self.step)

    def test_refused_changes_leave_everything_as_it_was(self):
        for bad in ({"max_range": 25}, {"train_angle_deg": 60}, {"data_points": 300}, {"max_range": 1000}):
            config = self.client.update_configuration(bad)
            assert {name: config[name] for name in bad} == {name: DEFAULTS[name] for name in bad}
        assert self.fresh_beams(1)[0].maxrange_meters == 20.0

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


if __name__ == "__main__":
    run(TestDriver)
