#!/usr/bin/env python3
import math
import unittest

from driver_behaviour import DriverBehaviour
from driver_listener import diagnostics, values
from graph import run

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


class TestDriver(DriverBehaviour, unittest.TestCase):
    sonar, defaults, wall, step = "ping360", DEFAULTS, 4.0, 4 * GRADIAN

    def is_of_defaults(self, beam):
        return len(beam.intensities) == 400 and beam.gain == 1

    def test_a_beam_says_how_it_was_made(self):
        beam = self.fresh_beams(1)[0]
        assert (beam.header.frame_id, len(beam.intensities), beam.gain) == ("sonar", 400, 1)
        assert abs(beam.maxrange_meters - 8.0) < 0.05
        assert abs(beam.range_resolution - beam.maxrange_meters / 400) < 1e-6

    def test_accepted_changes_reach_the_head(self):
        self.client.update_configuration({"max_range": 2.0, "gain_setting": 2, "sector_width_deg": 18.0})
        beam = self.wait_for_beam(lambda beam: abs(beam.maxrange_meters - 2.0) < 0.02)
        assert beam.gain == 2
        assert all(abs(beam.angle) < 10.5 * GRADIAN for beam in self.fresh_beams(20)[4:])

    def test_a_slower_sound_shortens_the_bins_of_the_same_time(self):
        self.client.update_configuration({"speed_of_sound": 1400.0})
        period = DEFAULTS["max_range"] / 400 / 1500.0
        self.wait_for_beam(lambda beam: abs(beam.range_resolution / 1400.0 - period * 1500 / 1400) < 1e-8)

    def test_request_mode_scans_too(self):
        health = diagnostics("ping360_driver")
        self.client.update_configuration({"scan_mode": "request"})
        assert health.wait(lambda arrays: bool(arrays) and values(arrays[-1])["scan mode"] == "request")
        self.beams.wait_for_more(5)

    def test_refused_changes_leave_everything_as_it_was(self):
        for bad in ({"max_range": 0.5}, {"transmit_duration_us": 3}, {"gain_setting": 3}):
            config = self.client.update_configuration(bad)
            assert all(config[name] != value for name, value in bad.items())
        assert abs(self.fresh_beams(1)[0].maxrange_meters - 8.0) < 0.05

    def test_the_pulse_is_told_as_the_head_made_it(self):
        told = values(diagnostics("ping360_driver").wait_for_more(2)[-1])
        assert (told["firmware"], told["samples"], told["transmit duration [us]"]) == ("3.3.1", "400", "67")
        assert told["sample period [us]"] == "26.675"

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


if __name__ == "__main__":
    run(TestDriver)
