import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from node_support.geometry import pose_matrix, yaw_of
from sonar_simulator.vehicle.scripted_vehicle import ScriptError, VehicleScript

MOVES = [
    {"wait": 2.0},
    {"x": 4.0, "y": -3.0, "z": -0.5, "yaw_deg": 120.0, "speed": 0.8},
    {"yaw_deg": -200.0, "turn_rate_deg": 30.0},
    {"x": -6.0, "seconds": 7.0},
    {"wait": 1.0},
]
SCRIPT = VehicleScript.from_yaml_data(MOVES, {"x": 1.0, "y": 2.0, "yaw_deg": 90.0})
TIMES = st.floats(-1.0, SCRIPT.duration + 1.0)


def test_a_script_starts_at_its_start():
    np.testing.assert_allclose(SCRIPT.pose(0.0), pose_matrix((1, 2, -2), (0, 0, math.pi / 2)))


def test_a_script_ends_at_the_sum_of_its_moves_and_stays_there():
    expected = pose_matrix((-1, -1, -2.5), (0, 0, math.radians(10.0)))
    np.testing.assert_allclose(SCRIPT.pose(SCRIPT.duration), expected, atol=1e-12)
    np.testing.assert_allclose(SCRIPT.pose(SCRIPT.duration + 100.0), expected, atol=1e-12)


@given(TIMES)
def test_the_twist_is_the_derivative_of_the_pose_seen_from_the_body(time):
    step = 1e-4
    before, after = SCRIPT.pose(time - step), SCRIPT.pose(time + step)
    linear = SCRIPT.pose(time)[:3, :3].T @ (after[:3, 3] - before[:3, 3]) / (2.0 * step)
    angular = yaw_of(np.linalg.inv(before) @ after) / (2.0 * step)
    np.testing.assert_allclose(SCRIPT.state(time).twist, [*linear, 0.0, 0.0, angular], atol=1e-3)


@given(TIMES)
def test_pose_and_twist_are_continuous(time):
    step = 1e-6
    np.testing.assert_allclose(SCRIPT.pose(time + step), SCRIPT.pose(time), atol=1e-5)
    np.testing.assert_allclose(SCRIPT.state(time + step).twist, SCRIPT.state(time).twist, atol=1e-5)


def test_speed_is_the_greatest_speed_of_a_move():
    script = VehicleScript.from_yaml_data([{"x": 3.0, "y": 4.0, "speed": 0.5}])
    speeds = [np.linalg.norm(script.state(time).twist[:3]) for time in np.linspace(0.0, script.duration, 2001)]
    assert max(speeds) == pytest.approx(0.5)


def test_turn_rate_is_the_greatest_rate_of_a_turn():
    script = VehicleScript.from_yaml_data([{"yaw_deg": -90.0, "turn_rate_deg": 20.0}])
    rates = [script.state(time).twist[5] for time in np.linspace(0.0, script.duration, 2001)]
    assert min(rates) == pytest.approx(-math.radians(20.0))


def test_a_move_takes_the_seconds_asked_for():
    assert VehicleScript.from_yaml_data([{"x": 5.2, "seconds": 15.6}]).duration == 15.6


def test_a_tilt_is_commanded_when_the_entries_before_it_are_done_and_takes_no_time():
    script = VehicleScript.from_yaml_data(
        [{"wait": 2.0}, {"tilt_deg": 30.0}, {"x": 1.0, "seconds": 3.0}, {"tilt_deg": 0}]
    )
    assert script.duration == 5.0
    assert [(c.time, round(math.degrees(c.angle))) for c in script.tilt_commands] == [(2.0, 30), (5.0, 0)]
    np.testing.assert_allclose(script.pose(5.0), pose_matrix((1.0, 0.0, -2.0)))


def test_a_vehicle_is_still_while_it_waits_and_outside_the_script_only():
    assert [SCRIPT.state(time).is_still for time in (-1.0, 0.0, 1.9, 2.0, 2.5)] == [True, True, True, False, False]
    assert [SCRIPT.state(SCRIPT.duration + late).is_still for late in (-1.5, -0.5, 0.0, 9.0)] == [
        False,
        True,
        True,
        True,
    ]


@pytest.mark.parametrize(
    ("moves", "text"),
    [
        ([{"wait": 1.0}, {"x": "far"}], r"entry 2: x = 'far': must be a number"),
        ([{"x": 1.0, "speed": 0}], r"entry 1: speed = 0: must be a number from 0.001 m/s"),
        ([{"x": 1.0, "sped": 1}], r"entry 1: sped = 1: no such parameter; did you mean speed\? there are x, y"),
        ([{"wait": -1}], r"entry 1: wait = -1: must be a number from 0 s"),
        ([{"wait": 1, "x": 2}], r"entry 1: x = 2: no such parameter; there are wait"),
        ([{"x": math.nan}], r"entry 1: x = nan"),
        ([{}], r"entry 1: x, y, z, yaw_deg are all 0"),
        (["wait"], r"entry 1 = 'wait': must be keys and values"),
        ([], r"moves = \[\]: must be a list"),
        (None, r"moves = None: must be a list"),
    ],
)
def test_a_bad_entry_is_refused_with_its_number_key_and_what_is_allowed(moves, text):
    with pytest.raises(ScriptError, match=text):
        VehicleScript.from_yaml_data(moves)


def test_a_bad_start_is_refused():
    with pytest.raises(ScriptError, match="start: depth = 2"):
        VehicleScript.from_yaml_data(MOVES, {"depth": 2})
