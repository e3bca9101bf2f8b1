import pytest

from imagenex_852_driver.emulated_852 import EmulatorParameters
from imagenex_852_driver.line.parameters import DriverParameters
from node_support.parameters import ParameterError


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"train_angle_deg": 60}, "the sector would end at 240 deg"),
        ({"max_range": 25}, "max_range = 25: must be one of 5, 10"),
        ({"back_off_first": 0.9, "back_off_longest": 0.5}, "longer than back_off_longest"),
        ({"frame_id": ""}, "frame_id = '': must be a non-empty string"),
        ({"tilt": 1.0}, "tilt = 1.0: no such parameter"),
    ],
)
def test_the_driver_refuses_what_the_line_the_head_or_the_node_cannot_do(values, complaint):
    with pytest.raises(ParameterError, match=complaint):
        DriverParameters.from_mapping(values)


def test_the_drivers_parameters_command_the_head_and_time_the_line():
    parameters = DriverParameters(max_range=30, baud_rate=9600)
    assert parameters.command().max_range == 30
    assert parameters.timing().baud_rate == 9600


def test_a_head_needs_no_joint():
    assert DriverParameters().sensor_joint == ""


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
