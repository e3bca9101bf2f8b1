import pytest

from node_support.parameters import ParameterError
from ping360_driver.parameters import DriverParameters, HeadSettings
from ping360_driver.scan_command import ScanCommand, SectorWalk


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"max_range": 0.5}, "max_range = 0.5: must be a number from 0.75 to 50"),
        ({"gain_setting": 3}, "gain_setting = 3: must be an integer from 0 to 2"),
        ({"transmit_duration_us": 3}, "transmit_duration_us = 3: must be 0, or from 5 to 500 us"),
        ({"transmit_duration_us": 400, "max_range": 2.0}, "the head makes at most 284 us"),
        ({"sector_width_deg": 1.8, "step_gradians": 10}, "narrower than step_gradians = 10"),
        ({"step_gradians": 11}, "step_gradians = 11: must be an integer from 1 to 10"),
        ({"scan_mode": "by_hand"}, "must be one of auto_transmit, request"),
    ],
)
def test_what_line_or_head_cannot_do_is_refused(values, complaint):
    with pytest.raises(ParameterError, match=complaint):
        DriverParameters.from_mapping(values)


def test_line_and_frame_cannot_be_changed_while_the_driver_runs():
    names = {field.name for field in DriverParameters.tunable_fields()}
    assert {"max_range", "gain_setting", "frequency_khz", "step_gradians", "speed_of_sound"} <= names
    assert names.isdisjoint({"port", "baud_rate", "frame_id"})


@pytest.mark.parametrize(
    ("sector", "start", "stop"),
    [({}, 0, 399), ({"train_angle_deg": 90.0, "sector_width_deg": 90.0}, 250, 350)],
    ids=["whole turn", "clockwise from ahead"],
)
def test_a_sector_is_centred_clockwise_from_ahead_and_usually_the_whole_turn(sector, start, stop):
    command = HeadSettings(**sector).command()
    assert (command.start, command.stop, command.step, command.is_full_turn) == (start, stop, 1, not sector)


@pytest.mark.parametrize(
    ("settings", "can"),
    [
        ({}, True),
        ({"sector_width_deg": 90.0}, True),
        ({"sector_width_deg": 90.0, "train_angle_deg": 180.0}, False),
        ({"sector_width_deg": 0.0}, False),
        ({"scan_mode": "request"}, False),
    ],
)
def test_the_head_scans_by_itself_what_does_not_lie_astern(settings, can):
    assert HeadSettings.from_mapping(settings).command().can_auto_transmit is can


def test_a_pulse_of_the_users_own_is_used():
    assert HeadSettings(transmit_duration_us=50).command().pulse.transmit_duration == 50


def test_the_speed_of_sound_turns_the_range_into_a_time():
    slow, fast = (HeadSettings(speed_of_sound=speed).command().pulse.sample_period for speed in (1400.0, 1550.0))
    assert slow / fast == pytest.approx(1550 / 1400, rel=0.002)


@pytest.mark.parametrize(
    ("sector", "expected"),
    [
        ({}, [*range(400), 0, 1]),
        # To and fro, and to the edges of the sector.
        ({"center": 200, "width": 10, "step": 4}, [195, 199, 203, 205, 201, 197, 195, 199]),
        ({"center": 0, "width": 4}, [398, 399, 0, 1, 2]),
        ({"center": 120, "width": 0}, [120, 120, 120]),
    ],
    ids=["full turn", "sector", "astern", "fixed beam"],
)
def test_by_request_the_sector_is_walked_through(sector, expected):
    steps = SectorWalk()
    assert [steps.next(ScanCommand(**sector)) for _ in expected] == expected


def test_a_changed_sector_begins_at_its_start():
    steps = SectorWalk()
    steps.next(ScanCommand())
    assert steps.next(ScanCommand(center=200, width=20)) == 190
