"""Which settings of the head, the line and the emulated head are accepted, and the command that they make."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from imagenex_852_driver.emulated_852 import EmulatorParameters
from imagenex_852_driver.parameters import Direction, DriverParameters, HeadSettings
from node_support.parameters import ParameterError


def test_the_defaults_are_a_full_turn_in_steps_of_three_degrees():
    command = HeadSettings().command()
    assert (command.sector_width_deg, command.step_size_deg, command.train_angle_deg) == (360, 3, 0)


def test_every_setting_reaches_the_command():
    settings = HeadSettings(
        max_range=50, direction=Direction.COUNTERCLOCKWISE, start_gain_db=12, absorption_db_per_m=0.35,
        train_angle_deg=90, sector_width_deg=60, step_size_deg=6, pulse_length_us=42, data_points=250,
        switch_delay_ms=8, frequency_khz=850, head_id=0x11,
    )  # fmt: skip
    expected = "fe441132004000000c00236414022a0000000019000000000401fd"
    assert settings.command().encode() == bytes.fromhex(expected)


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"max_range": 25}, "max_range = 25: not allowed by the protocol, which takes 5, 10"),
        ({"start_gain_db": 41}, "start_gain_db = 41"),
        ({"train_angle_deg": 10}, "train_angle_deg = 10"),
        ({"train_angle_deg": 60}, "the sector would end at 240 deg"),
        ({"sector_width_deg": 100}, "sector_width_deg = 100"),
        ({"sector_width_deg": 3, "step_size_deg": 6}, "narrower"),
        ({"step_size_deg": 2}, "step_size_deg = 2"),
        ({"data_points": 300}, "data_points = 300"),
        ({"switch_delay_ms": 3}, "switch_delay_ms = 3"),
        ({"frequency_khz": 700}, "frequency_khz = 700"),
        ({"pulse_length_us": 0}, "pulse_length_us = 0"),
        ({"absorption_db_per_m": 2.6}, "absorption_db_per_m = 2.6"),
        ({"direction": "left"}, "direction = 'left'"),
        ({"head_id": 0x16}, "head_id = 22"),
        # These would end the command.
        ({"pulse_length_us": 253}, "pulse_length_us = 253"),
        ({"switch_delay_ms": 506}, "switch_delay_ms = 506"),
        ({"absorption_db_per_m": 2.53}, "absorption_db_per_m = 2.53"),
        ({"back_off_first": 0.9, "back_off_longest": 0.5}, "longer than back_off_longest"),
        ({"frame_id": ""}, "frame_id = '': must be a non-empty string"),
        ({"tilt": 1.0}, "tilt = 1.0: no such parameter"),
    ],
)
def test_what_the_line_the_head_or_the_node_cannot_do_is_refused(values, complaint):
    with pytest.raises(ParameterError, match=complaint):
        DriverParameters.from_mapping(values)


def test_a_sector_that_ends_at_the_stop_is_accepted():
    assert HeadSettings(train_angle_deg=-30, sector_width_deg=360).train_angle_deg == -30


@given(st.integers(0, 255), st.floats(0, 2.55), st.integers(0, 510), st.integers(-210, 210), st.integers(0, 360))
def test_settings_that_exist_never_put_the_terminator_inside_a_command(pulse, absorption, delay, train, sector):
    try:
        settings = HeadSettings(
            pulse_length_us=pulse, absorption_db_per_m=absorption, switch_delay_ms=delay, train_angle_deg=train,
            sector_width_deg=sector,
        )  # fmt: skip
    except ParameterError:
        return
    assert settings.command().encode().index(0xFD) == 26


def test_the_port_cannot_be_changed_while_the_driver_runs():
    names = {field.name for field in DriverParameters.tunable_fields()}
    assert "max_range" in names
    assert names.isdisjoint({"port", "baud_rate", "head_id", "frame_id"})


@pytest.mark.parametrize(
    "values", [{"dropped": 0.7, "late": 0.7}, {"echo_source": "tank"}, {"head_id": 3}, {"wall_distance": 0.0}]
)
def test_the_emulator_refuses_what_makes_no_head(values):
    with pytest.raises(ParameterError, match=next(iter(values))):
        EmulatorParameters.from_mapping(values)
