import math

import numpy as np
import pytest
from programs import ROOT

from node_support.geometry import pose_matrix
from node_support.parameters import ParameterError
from sonar_simulator.simulation.robot import RobotDescription
from sonar_simulator.simulation.simulation import Settings, Simulation

CHARLE = RobotDescription.from_file(ROOT / "urdf/charle.urdf")
QUICK = {"sonar": {"ray_rows": 5, "ray_columns": 3}}
SCRIPT = """
start: {x: -2.0, z: -1.2}
moves:
  - {wait: 2}
  - {tilt_deg: 30}
  - {x: 3, seconds: 4}
  - {tilt_deg: -10}
  - {wait: 3}
"""


@pytest.fixture
def script(tmp_path):
    path = tmp_path / "script.yaml"
    path.write_text(SCRIPT)
    return str(path)


def _simulation(script, **values):
    settings = Settings.from_mapping({"world": "worlds/tank.sdf", "script": script, **QUICK, **values})
    return Simulation(settings, ROOT, CHARLE, pytest.fail)


def _moments(script, beams_at_once=1, **values):
    return list(_simulation(script, **values).moments(20.0, beams_at_once))


def test_ticks_and_beams_come_in_order_each_at_its_own_rate(script):
    moments = _moments(script)
    times = [moment.time for moment in moments]
    assert times == sorted(times)
    assert len(set(times)) == len(times)
    assert [m.time for m in moments if m.is_tick] == pytest.approx(np.arange(181) / 20.0)
    assert [m.time for m in moments if m.ping] == pytest.approx(np.arange(68) * 16.0 / 120)


@pytest.mark.parametrize("beams_at_once", [7, 120])
def test_casting_many_beams_at_once_leaves_everything_but_their_noise_as_it_is(script, beams_at_once):
    one_by_one, at_once = _moments(script), _moments(script, beams_at_once)
    assert len(one_by_one) == len(at_once)
    for first, second in zip(one_by_one, at_once):
        assert (first.time, first.tilt, first.is_tick) == (second.time, second.tilt, second.is_tick)
        assert (first.ping is None) == (second.ping is None)
        np.testing.assert_array_equal(first.odometry.T_odom_base, second.odometry.T_odom_base)


def test_the_servo_follows_the_script_at_its_own_speed(script):
    tilts = {round(m.time, 2): math.degrees(m.tilt) for m in _moments(script, servo={"speed_deg": 20.0})}
    assert [tilts[t] for t in (1.9, 2.5, 3.5, 6.0)] == pytest.approx([0.0, 10.0, 30.0, 30.0])
    assert tilts[9.0] == pytest.approx(-10.0)


def test_a_sonar_tilted_down_hears_the_floor_ahead_that_a_level_one_does_not(script):
    head = {"beams_per_turn": 4, "seconds_per_turn": 2.0}
    moments = _moments(script, sonar=head, laser_cone={"max_range": 3.0, "spread": 0.0, "noise_echoes": 0})
    ahead = {moment.time: moment.ping.strengths.any() for moment in moments if moment.ping and moment.ping.angle == 0.0}
    assert (ahead[0.0], ahead[4.0]) == (False, True)


def test_the_noise_of_the_odometry_leaves_the_beams_alone(script):
    quiet = [m.ping.strengths for m in _moments(script) if m.ping]
    noisy = [m.ping.strengths for m in _moments(script, odometry={"speed_noise": 0.5}) if m.ping]
    np.testing.assert_array_equal(quiet, noisy)


def test_a_commanded_vehicle_begins_at_the_scripts_start_and_never_ends(script):
    simulation = _simulation(script, drive="CMD_VEL")
    assert simulation.duration == math.inf
    np.testing.assert_array_equal(simulation.moment(5.0).truth.T_world_base, pose_matrix((-2.0, 0.0, -1.2)))
    simulation.commanded.command(5.0, np.array([0.5, 0, 0, 0, 0, 0]))
    assert simulation.moment(6.0).truth.T_world_base[0, 3] > -2.0


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"odometry": {"scale_eror": 0.1}}, r"odometry: scale_eror = 0.1: .*; did you mean scale_error\?"),
        ({"sonar": 3}, r"sonar = 3: must be keys and values"),
        ({"echo_model": "cone"}, r"echo_model = 'cone': must be one of laser_cone, collision, physical"),
        ({"physical": {"bins": 0}}, r"physical: bins = 0: must be an integer from 1"),
        ({"drive": "TELEOP"}, r"drive = 'TELEOP': must be one of SCRIPT, CMD_VEL"),
        ({"wrold": "x"}, r"wrold = 'x': no such parameter"),
    ],
)
def test_bad_settings_are_refused_with_group_key_and_what_is_allowed(values, text):
    with pytest.raises(ParameterError, match=text):
        Settings.from_mapping(values)


@pytest.mark.parametrize(
    ("values", "robot", "text"),
    [
        ({"world": "worlds/none.sdf"}, CHARLE, r"none\.sdf"),
        ({"script": "yaml/none.yaml"}, CHARLE, r"none\.yaml: No such file"),
        ({}, RobotDescription("<robot/>"), "no joints lead from base_link to sonar"),
    ],
)
def test_files_and_robots_that_cannot_be_used_are_named(script, values, robot, text):
    with pytest.raises(ParameterError, match=text):
        Simulation(Settings.from_mapping({"script": script, **values}), ROOT, robot, pytest.fail)
