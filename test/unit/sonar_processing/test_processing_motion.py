"""Moving or still, by the velocities that came."""

import math

import pytest

from node_support.errors import RefusedInput
from sonar_processing.scans.assembler import MovingState
from sonar_processing.scans.parameters import SonarToCloudParameters

PARAMETERS = SonarToCloudParameters(still_speed=0.05, still_turn_rate=0.01)
SECOND = 10**9
ZERO = (0.0, 0.0, 0.0)


def _motion(linear=ZERO, angular=ZERO):
    motion = MovingState()
    motion.take(linear, angular)
    return motion


def test_a_vehicle_never_heard_of_is_still():
    motion = MovingState()
    assert (motion.was_heard, motion.is_moving(PARAMETERS)) == (False, False)


@pytest.mark.parametrize(
    ("linear", "angular", "is_moving"),
    [
        *((linear, ZERO, True) for linear in ((0.06, 0, 0), (0, -0.06, 0), (0, 0, 0.06), (0.04, 0.04, 0))),
        *((ZERO, angular, True) for angular in ((0, 0, 0.02), (-0.02, 0, 0))),
        ((0.03, -0.03, 0.02), (0.0, 0.0, 0.009), False),
    ],
)
def test_a_velocity_above_the_dead_band_is_moving(linear, angular, is_moving):
    assert _motion(linear, angular).is_moving(PARAMETERS) is is_moving


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_velocity_that_is_none_is_refused_and_the_last_one_stays(bad):
    motion = _motion(linear=(1.0, 0.0, 0.0))
    with pytest.raises(RefusedInput) as refused:
        motion.take((bad, 0.0, 0.0), ZERO)
    assert refused.value.kind == "velocities refused"
    assert motion.is_moving(PARAMETERS)


def test_the_age_of_a_velocity_is_counted_in_the_time_of_the_beams():
    motion = _motion()
    assert [motion.age(seconds * SECOND) for seconds in (100, 101, 103)] == [0.0, 1.0, 3.0]
    motion.take(ZERO, ZERO)
    assert motion.age(104 * SECOND) == 0.0


def test_time_that_jumps_back_makes_no_velocity_old():
    motion = _motion()
    motion.age(1000 * SECOND)
    assert [motion.age(seconds * SECOND) for seconds in (5, 6)] == [0.0, 1.0]
