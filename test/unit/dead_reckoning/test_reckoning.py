"""Headings and velocities become a path."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dead_reckoning.dead_reckoner import (
    DeadReckoner,
    DeadReckoningParameters,
    HeadingType,
    depth_of_pressure,
    rotation_of_heading,
)
from node_support.errors import RefusedInput
from node_support.geometry import pose_matrix, yaw_of

SECOND = 10**9
START = 1000 * SECOND


def heading(yaw, roll=0.0, pitch=0.0):
    return pose_matrix((0, 0, 0), (roll, pitch, yaw))[:3, :3]


def reckoned(reckoner, seconds, yaw_at, rate=10.0, start=START):
    """Take headings `yaw_at(t)` for `seconds`, `rate` times a second, and return the last reckoning."""
    result = None
    for step in range(int(seconds * rate) + 1):
        result = reckoner.take_orientation(start + int(step / rate * SECOND), heading(yaw_at(step / rate)))
    return result


@pytest.fixture
def reckoner():
    return DeadReckoner(DeadReckoningParameters())


@given(yaw=st.floats(-3.0, 3.0), surge=st.floats(-2.0, 2.0), sway=st.floats(-2.0, 2.0))
def test_a_straight_way_is_velocity_times_time_along_the_heading(yaw, surge, sway):
    reckoner, velocity = DeadReckoner(DeadReckoningParameters()), np.array([surge, sway, 0.0])
    reckoner.take_velocity(START, velocity)
    done = reckoned(reckoner, 10.0, lambda _: yaw)
    np.testing.assert_allclose(done.T_odom_base[:3, 3], 10.0 * heading(yaw) @ velocity, atol=1e-9)


def test_a_steady_turn_is_a_circle_even_where_headings_are_few(reckoner):
    speed, rate = 0.5, 0.1
    reckoner.take_velocity(START, np.array([speed, 0.0, 0.0]))
    done = reckoned(reckoner, 2.0 * np.pi / rate, lambda t: rate * t, rate=2.0)
    at_half = 2.0 * speed / rate
    assert np.hypot(*done.T_odom_base[:2, 3]) < 0.02 * at_half
    assert done.turn_rate == pytest.approx(rate)


def test_the_orientation_is_the_one_that_was_measured_and_depth_is_downward(reckoner):
    rotation = heading(2.0, roll=0.2, pitch=-0.3)
    reckoner.take_depth(7.5)
    done = reckoner.take_orientation(START, rotation)
    np.testing.assert_allclose(done.T_odom_base[:3, :3], rotation)
    assert done.T_odom_base[2, 3] == -7.5


def test_a_new_velocity_does_not_move_the_vehicle_at_once(reckoner):
    reckoner.take_velocity(START, np.array([0.5, 0.0, 0.0]))
    before = reckoned(reckoner, 5.0, lambda _: 0.0)
    reckoner.take_velocity(START + 5 * SECOND, np.array([-2.0, 1.0, 0.0]))
    after = reckoner.take_orientation(START + 5 * SECOND + 1, np.eye(3))
    np.testing.assert_allclose(after.T_odom_base, before.T_odom_base, atol=1e-6)


def reckoner_of(source):
    return DeadReckoner(DeadReckoningParameters(velocity_source=source))


@pytest.mark.parametrize(("source", "timeout"), [("ESTIMATE", 120.0), ("COMMANDS", 1.0)])
def test_the_vehicle_stops_when_its_velocity_is_too_old(source, timeout):
    reckoner = reckoner_of(source)
    reckoner.take_velocity(START, np.array([1.0, 0.0, 0.0]))
    done = reckoned(reckoner, timeout + 50.0, lambda _: 0.0)
    assert done.T_odom_base[0, 3] == pytest.approx(timeout, abs=0.11)


def test_an_estimate_that_is_not_followed_by_another_fades(reckoner):
    """With one every 10 s, the next one is overdue after 20 s; 40 s later a third of it is left."""
    for second in (0, 10, 20):
        reckoner.take_velocity(START + second * SECOND, np.array([0.5, 0.1, 0.0]))
    kept = reckoned(reckoner, 40.0, lambda _: 0.0, start=START)
    np.testing.assert_allclose(kept.velocity, [0.5, 0.1, 0.0])
    faded = reckoner.take_orientation(START + 80 * SECOND, heading(0.0))
    np.testing.assert_allclose(faded.velocity, np.exp(-1.0) * np.array([0.5, 0.1, 0.0]))


def test_a_measured_velocity_tilts_with_the_vehicle():
    reckoner = reckoner_of("MEASURED")
    nose_down = heading(1.0, pitch=0.5)
    reckoner.take_velocity(START, nose_down.T @ np.array([0.3, 0.4, 0.0]))
    for second in (0, 2):
        done = reckoner.take_orientation(START + second * SECOND, nose_down)
    np.testing.assert_allclose(done.T_odom_base[:2, 3], [0.6, 0.8], atol=1e-9)


def test_an_instrument_off_the_centre_of_a_turn_moves_the_vehicle_no_further():
    """The vehicle turns on the spot; 0.4 m to the left of its middle the water goes by at 0.04 m/s."""
    reckoner = reckoner_of("MEASURED")
    reckoner.take_velocity(START, np.array([-0.04, 0.0, 0.0]), instrument=(0.0, 0.4))
    done = reckoned(reckoner, 10.0, lambda t: 0.1 * t)
    assert np.abs(done.T_odom_base[:2, 3]).max() < 1e-9


def test_commands_do_not_fade():
    reckoner = reckoner_of("COMMANDS")
    for tenth in range(3):
        reckoner.take_velocity(START + tenth * SECOND // 10, np.array([0.5, 0.0, 0.0]))
    assert reckoner.take_orientation(START + SECOND, heading(0.0)).velocity[0] == 0.5


def test_a_gap_longer_than_the_parameter_is_told(reckoner):
    assert reckoner.take_orientation(START, np.eye(3)).gap == 0.0
    assert reckoner.take_orientation(START + SECOND, np.eye(3)).gap == 0.0
    assert reckoner.take_orientation(START + 4 * SECOND, np.eye(3)).gap == 3.0


def test_a_heading_that_is_not_newer_is_refused_and_changes_nothing(reckoner):
    reckoner.take_velocity(START, np.array([1.0, 0.0, 0.0]))
    reckoner.take_orientation(START, np.eye(3))
    with pytest.raises(RefusedInput, match="not newer than the last"):
        reckoner.take_orientation(START, heading(1.0))
    assert reckoner.take_orientation(START + SECOND, np.eye(3)).T_odom_base[0, 3] == pytest.approx(1.0)


def test_the_vehicle_starts_anew_when_time_jumps_back(reckoner):
    reckoner.take_velocity(START, np.array([1.0, 0.0, 0.0]))
    reckoned(reckoner, 10.0, lambda _: 0.0)
    done = reckoner.take_orientation(START, heading(1.0))
    assert not done.T_odom_base[:3, 3].any()
    assert not done.velocity.any()
    assert yaw_of(done.T_odom_base) == pytest.approx(1.0)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e5])
def test_a_velocity_that_no_vehicle_and_a_depth_that_no_sea_has_are_refused(reckoner, value):
    with pytest.raises(RefusedInput, match="must be finite and at most 20 m/s"):
        reckoner.take_velocity(START, np.array([0.0, value, 0.0]))
    with pytest.raises(RefusedInput, match="must be finite and at most 11000 m"):
        reckoner.take_depth(value)


def test_ten_metres_of_fresh_water_weigh_about_one_atmosphere():
    assert depth_of_pressure(2 * 101325.0, 101325.0, 1000.0) == pytest.approx(10.33, abs=0.01)


AHEAD = np.array([1.0, 0.0, 0.0])
EAST, NORTH = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("heading", "ahead"), [(0.0, NORTH), (90.0, EAST), (180.0, -NORTH), (270.0, -EAST), (-90.0, -EAST)]
)
def test_headings_count_clockwise_from_north(heading, ahead):
    np.testing.assert_allclose(rotation_of_heading(heading, HeadingType.COMPASS_DEGREES) @ AHEAD, ahead, atol=1e-12)
    in_radians = rotation_of_heading(np.radians(heading), HeadingType.COMPASS_RADIANS)
    np.testing.assert_allclose(in_radians @ AHEAD, ahead, atol=1e-12)


def test_left_stays_left():
    left = np.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose(rotation_of_heading(0.0, HeadingType.COMPASS_DEGREES) @ left, -EAST, atol=1e-12)


@pytest.mark.parametrize(
    ("heading", "unit"), [*((one, "DEGREES") for one in (np.nan, np.inf, -np.inf, 721.0)), (200.0, "RADIANS")]
)
def test_what_is_no_heading_and_degrees_that_are_taken_for_radians_are_refused(heading, unit):
    with pytest.raises(RefusedInput, match=f"{heading} {unit[:3].lower()}, must be .* see heading_type"):
        rotation_of_heading(heading, HeadingType[f"COMPASS_{unit}"])
