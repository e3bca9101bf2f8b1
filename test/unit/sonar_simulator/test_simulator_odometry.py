import math
from functools import lru_cache

import numpy as np
import pytest

from node_support.geometry import pose_matrix, yaw_of
from sonar_simulator.simulation.odometry import Odometry, OdometryParameters
from sonar_simulator.simulation.scripted_vehicle import VehicleScript, VehicleState

pytestmark = pytest.mark.long

START = {"x": 10.0, "y": 5.0, "z": -2.0, "yaw_deg": 20.0}
WAY = VehicleScript.from_yaml_data(
    [
        {"x": 12.0, "y": 5.0, "z": -1.0, "yaw_deg": 100.0, "speed": 0.6},
        {"x": -8.0, "y": 9.0, "yaw_deg": -250.0, "speed": 0.5},
        {"wait": 5.0},
    ],
    START,
)
RESTING = VehicleState(WAY.pose(0.0), np.zeros(6), True)


def _odometry(seed=0, **errors):
    return Odometry(OdometryParameters(**{"scale_error": 0.0, **errors}), WAY.pose(0.0), np.random.default_rng(seed))


@lru_cache(maxsize=None)
def _states(way, rate):
    return [(time, way.state(time)) for time in np.arange(0.0, way.duration, 1.0 / rate)]


def _estimates(odometry, rate=20.0, way=WAY):
    return [odometry.estimate(time, state) for time, state in _states(way, rate)]


def test_without_errors_odometry_is_the_truth():
    for time, estimate in zip(np.arange(0.0, WAY.duration, 0.05), _estimates(_odometry())):
        np.testing.assert_allclose(estimate.T_odom_base, WAY.pose(time), atol=1e-9)
        np.testing.assert_allclose(estimate.twist, WAY.state(time).twist, atol=1e-12)


def test_with_30_percent_error_4_m_of_odometry_are_5_2_m_of_way_and_depth_and_heading_are_true():
    there = VehicleState(pose_matrix((15.2, 5.0, -3.0), (0.0, 0.0, 1.0)), np.zeros(6), True)
    estimate = _odometry(scale_error=0.3).estimate(9.0, there)
    np.testing.assert_allclose(estimate.T_odom_base, pose_matrix((14.0, 5.0, -3.0), (0.0, 0.0, 1.0)), atol=1e-12)


def test_odometry_gives_speeds_off_by_its_error_and_true_heave_and_turn_rates():
    state = VehicleState(WAY.pose(0.0), np.array([1.0, 0.5, 0.3, 0.0, 0.0, 0.2]), False)
    np.testing.assert_allclose(_odometry(scale_error=0.25).estimate(0.0, state).twist, [0.8, 0.4, 0.3, 0.0, 0.0, 0.2])


def test_the_heading_drifts_at_the_rate_asked_for_also_while_the_vehicle_rests():
    odometry = _odometry(heading_drift_deg_per_minute=6.0)
    yaw = yaw_of(odometry.estimate(30.0, RESTING).T_odom_base)
    assert math.degrees(yaw) == pytest.approx(20.0 + 3.0)


def test_a_drifting_heading_bends_a_straight_way_into_an_arc():
    straight = VehicleScript.from_yaml_data([{"x": 60.0, "seconds": 60.0}], {})
    parameters = OdometryParameters(scale_error=0.0, heading_drift_deg_per_minute=10.0)
    odometry = Odometry(parameters, straight.pose(0.0), np.random.default_rng(0))
    x, y = _estimates(odometry, way=straight)[-1].T_odom_base[:2, 3]
    assert math.hypot(x, y) == pytest.approx(60.0, rel=0.01)
    assert math.degrees(math.atan2(y, x)) == pytest.approx(5.0, abs=0.1)


def test_drift_and_scale_do_not_depend_on_how_often_odometry_is_asked():
    errors = {"scale_error": 0.2, "heading_drift_deg_per_minute": 20.0}
    often, seldom = (_estimates(_odometry(**errors), rate)[-1].T_odom_base for rate in (40.0, 2.0))
    np.testing.assert_allclose(often[:2, 3], seldom[:2, 3], atol=0.1)


def test_noise_grows_with_its_parameter_and_has_no_bias():
    def ends(noise):
        estimates = (_estimates(_odometry(seed, speed_noise=noise), 2.0)[-1] for seed in range(30))
        return np.array([estimate.T_odom_base[:2, 3] - WAY.pose(WAY.duration)[:2, 3] for estimate in estimates])

    small, large = ends(0.05), ends(0.2)
    np.testing.assert_allclose(large, 4.0 * small, atol=1e-6)
    assert 0.05 < small.std() < 0.3
    assert np.abs(small.mean(axis=0)).max() < 3.0 * small.std() / math.sqrt(30)


def test_the_noise_of_the_turn_rate_makes_the_heading_walk():
    ends = [yaw_of(_estimates(_odometry(seed, turn_rate_noise_deg=1.0), 2.0)[-1].T_odom_base) for seed in range(40)]
    errors = np.degrees(np.array(ends) - yaw_of(WAY.pose(WAY.duration)))
    moving = WAY.duration - 5.0
    assert errors.std() == pytest.approx(math.sqrt(2.0 * moving), rel=0.4)


def test_a_vehicle_that_rests_is_measured_to_rest():
    odometry = _odometry(speed_noise=0.5, turn_rate_noise_deg=5.0)
    for time in np.arange(0.0, 5.0, 0.1):
        estimate = odometry.estimate(time, RESTING)
        np.testing.assert_array_equal(estimate.twist, np.zeros(6))
        np.testing.assert_allclose(estimate.T_odom_base, WAY.pose(0.0), atol=1e-12)


def test_a_turn_through_180_degrees_is_no_jump():
    turn = VehicleScript.from_yaml_data([{"yaw_deg": 200.0, "x": 5.0, "seconds": 20.0}], {"yaw_deg": 90.0})
    odometry = Odometry(OdometryParameters(scale_error=0.0), turn.pose(0.0), np.random.default_rng(0))
    np.testing.assert_allclose(_estimates(odometry, way=turn)[-1].T_odom_base[:2, 3], (5.0, 0.0), atol=0.01)
