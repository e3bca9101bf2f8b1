import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from node_support.errors import RefusedInput
from node_support.geometry import yaw_of
from sonar_simulator.simulation.commanded_vehicle import CommandedVehicle, VehicleParameters

PARAMETERS = VehicleParameters()
SURGE = np.array([0.8, 0.0, 0.0, 0.0, 0.0, 0.0])


def _vehicle(**values):
    return CommandedVehicle(PARAMETERS.changed(values), np.array([1.0, 2.0, -2.0, 0.0]))


def _driven(vehicle, twist, until, start=0.0):
    """Command a twist ten times a second and return the states."""
    states = []
    for time in np.arange(start, until, 0.1):
        vehicle.command(time, np.asarray(twist, dtype=float))
        states.append(vehicle.state(time))
    return states


def test_a_vehicle_without_commands_rests_at_its_start():
    state = _vehicle().state(10.0)
    assert state.is_still
    np.testing.assert_array_equal(state.T_world_base[:3, 3], (1.0, 2.0, -2.0))


@pytest.mark.parametrize(
    ("twist", "row"),
    [([0.8, 0, 0, 0, 0, 0], 0), ([0, 0.3, 0, 0, 0, 0], 1), ([0, 0, -0.2, 0, 0, 0], 2), ([0, 0, 0, 0, 0, 0.3], 5)],
    ids=["surge", "sway", "heave", "yaw"],
)
def test_it_reaches_the_commanded_speed_along_every_axis(twist, row):
    last = _driven(_vehicle(), twist, 8.0)[-1]
    assert last.twist[row] == pytest.approx(twist[row], rel=1e-3)
    assert not last.is_still
    assert np.count_nonzero(last.twist) == 1


def test_80_percent_of_a_command_are_reached_after_3_time_constants():
    vehicle = _vehicle(response_time=1.0, command_timeout=10.0)
    vehicle.command(0.0, SURGE)
    assert vehicle.state(3.0).twist[0] == pytest.approx(0.8 * 0.8, rel=0.01)


@given(st.lists(st.tuples(st.integers(1, 60), *[st.floats(-2.0, 2.0)] * 4), min_size=1, max_size=6))
def test_speed_and_acceleration_never_jump_whatever_is_commanded(commands):
    vehicle, twists = _vehicle(command_timeout=1.0), []
    for count, *wanted in commands:
        vehicle.command(0.01 * len(twists), np.array([*wanted[:3], 0.0, 0.0, wanted[3]]))
        twists += [vehicle.state(0.01 * (len(twists) + step)).twist for step in range(1, count + 1)]
    accelerations = np.diff(twists, axis=0) / 0.01
    limit = 2.0 * max(PARAMETERS.limits()) / PARAMETERS.response_time
    assert np.abs(accelerations).max(initial=0.0) < limit
    assert np.abs(np.diff(accelerations, axis=0)).max(initial=0.0) < 0.1 * limit


def test_it_stops_when_commands_cease():
    vehicle = _vehicle()
    _driven(vehicle, SURGE, 5.0)
    position = vehicle.state(5.0).T_world_base[0, 3]
    state = vehicle.state(15.0)
    assert state.is_still
    assert state.T_world_base[0, 3] - position < 0.8 * (PARAMETERS.command_timeout + 2.0 * PARAMETERS.response_time)
    np.testing.assert_allclose(vehicle.state(20.0).T_world_base, state.T_world_base, rtol=0.0, atol=1e-12)


def test_commands_are_in_the_frame_of_the_body():
    vehicle = _vehicle()
    _driven(vehicle, [0, 0, 0, 0, 0, 0.5], 2.0)
    yaw = yaw_of(vehicle.state(8.0).T_world_base)
    before = vehicle.state(8.0).T_world_base[:2, 3]
    _driven(vehicle, SURGE, 12.0, start=8.0)
    moved = vehicle.state(12.0).T_world_base[:2, 3] - before
    assert math.atan2(moved[1], moved[0]) == pytest.approx(yaw, abs=1e-6)


def test_the_pose_is_the_integral_of_the_twist_and_level():
    vehicle, step = _vehicle(), 1e-3
    _driven(vehicle, [0.8, 0.2, -0.1, 1.0, 1.0, 0.4], 3.0)
    before, after = vehicle.state(3.0), vehicle.state(3.0 + step)
    linear = before.T_world_base[:3, :3].T @ (after.T_world_base[:3, 3] - before.T_world_base[:3, 3]) / step
    np.testing.assert_allclose(linear, before.twist[:3], atol=2e-3)
    np.testing.assert_array_equal(after.T_world_base[2, :3], (0, 0, 1))


def test_speeds_are_limited_and_that_is_told():
    vehicle = _vehicle()
    assert vehicle.command(0.0, np.array([5.0, 0, 0, 0, 0, 0]))
    assert not vehicle.command(0.0, SURGE)
    twist = _driven(vehicle, [5.0, 0, 0, 0, 0, -9.0], 8.0)[-1].twist
    assert twist[[0, 5]] == pytest.approx([1.0, -math.pi / 6], rel=1e-3)


def test_it_does_not_rise_above_the_surface():
    last = _driven(_vehicle(), [0, 0, 0.4, 0, 0, 0], 20.0)[-1]
    assert last.T_world_base[2, 3] == 0.0
    assert last.twist[2] == 0.0


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_not_finite_is_refused_and_changes_nothing(bad):
    vehicle, other = _vehicle(), _vehicle()
    for each in (vehicle, other):
        each.command(0.0, SURGE)
    with pytest.raises(RefusedInput, match="every value must be finite"):
        vehicle.command(0.1, np.array([0, bad, 0, 0, 0, 0]))
    np.testing.assert_array_equal(vehicle.state(3.0).T_world_base, other.state(3.0).T_world_base)
