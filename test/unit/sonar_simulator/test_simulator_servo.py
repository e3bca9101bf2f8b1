import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from node_support.errors import RefusedInput
from node_support.parameters import ParameterError
from sonar_simulator.vehicle.robot import Servo, ServoParameters, tilted


def _servo(**values):
    return Servo(ServoParameters(**values))


def test_it_stands_at_0_until_it_is_told_otherwise():
    assert _servo().angle(5.0) == 0.0


def test_it_turns_at_its_speed_and_stops_at_the_goal():
    servo = _servo(speed_deg=60.0)
    servo.command(math.radians(-30.0))
    assert [math.degrees(servo.angle(time)) for time in (0.25, 0.5, 2.0)] == pytest.approx([-15.0, -30.0, -30.0])


@given(st.lists(st.tuples(st.floats(0.0, 2.0), st.floats(-10.0, 10.0)), min_size=1, max_size=20))
def test_it_is_never_faster_than_its_speed_nor_beyond_its_range(steps):
    servo, time, before = _servo(speed_deg=50.0, lowest_deg=-40.0, highest_deg=70.0), 0.0, 0.0
    for seconds, goal in steps:
        servo.command(goal)
        time += seconds
        angle = servo.angle(time)
        assert abs(angle - before) <= math.radians(50.0) * seconds + 1e-9
        assert math.radians(-40.0) <= angle <= math.radians(70.0)
        before = angle


def test_a_command_that_is_no_number_is_refused_and_the_goal_stays():
    servo = _servo()
    servo.command(0.2)
    with pytest.raises(RefusedInput, match="nan"):
        servo.command(math.nan)
    assert servo.angle(10.0) == pytest.approx(0.2)


def test_a_servo_without_range_is_refused():
    with pytest.raises(ParameterError, match="lowest_deg"):
        ServoParameters(lowest_deg=0.0, highest_deg=0.0)


def test_a_positive_angle_tilts_the_sonar_downwards():
    T_base_sonar = tilted(np.eye(4), math.radians(30.0))
    np.testing.assert_allclose(T_base_sonar[:3, 0], (math.cos(math.radians(30.0)), 0.0, -0.5), atol=1e-12)
