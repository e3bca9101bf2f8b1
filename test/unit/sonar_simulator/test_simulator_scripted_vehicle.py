"""Vehicles that follow scripts, and files of scripts."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from programs import ROOT

from node_support.geometry import pose_matrix, yaw_of
from node_support.parameters import ParameterError
from sonar_simulator.echoes.ray_caster import RayCaster
from sonar_simulator.simulation.odometry import Odometry, OdometryParameters
from sonar_simulator.simulation.scripted_vehicle import VehicleScript, load_script
from sonar_simulator.world.world_file import load_world

MOVES = [
    {"wait": 2.0},
    {"x": 4.0, "y": -3.0, "z": -0.5, "yaw_deg": 120.0, "speed": 0.8},
    {"yaw_deg": -200.0, "turn_rate_deg": 30.0},
    {"x": -6.0, "seconds": 7.0},
    {"wait": 1.0},
]
SCRIPT = VehicleScript.from_yaml_data(MOVES, {"x": 1.0, "y": 2.0, "yaw_deg": 90.0})
TIMES = st.floats(-1.0, SCRIPT.duration + 1.0)


def test_a_script_starts_at_its_start_ends_at_the_sum_of_its_moves_and_stays_there():
    np.testing.assert_allclose(SCRIPT.pose(0.0), pose_matrix((1, 2, -2), (0, 0, math.pi / 2)))
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


def test_speed_and_turn_rate_are_the_greatest_of_a_move_or_it_takes_the_seconds_asked_for():
    move = VehicleScript.from_yaml_data([{"x": 3.0, "y": 4.0, "speed": 0.5}])
    turn = VehicleScript.from_yaml_data([{"yaw_deg": -90.0, "turn_rate_deg": 20.0}])
    twists = [
        np.array([script.state(time).twist for time in np.linspace(0.0, script.duration, 2001)])
        for script in (move, turn)
    ]
    assert np.linalg.norm(twists[0][:, :3], axis=1).max() == pytest.approx(0.5)
    assert twists[1][:, 5].min() == pytest.approx(-math.radians(20.0))
    assert VehicleScript.from_yaml_data([{"x": 5.2, "seconds": 15.6}]).duration == 15.6


def test_a_tilt_is_commanded_when_the_entries_before_it_are_done_and_takes_no_time():
    script = VehicleScript.from_yaml_data([{"wait": 2.0}, {"tilt_deg": 30}, {"x": 1, "seconds": 3}, {"tilt_deg": 0}])
    assert script.duration == 5.0
    assert [(c.time, round(math.degrees(c.angle))) for c in script.tilt_commands] == [(2.0, 30), (5.0, 0)]
    np.testing.assert_allclose(script.pose(5.0), pose_matrix((1.0, 0.0, -2.0)))


def test_a_vehicle_is_still_while_it_waits_and_outside_the_script_only():
    assert [SCRIPT.state(time).is_still for time in (-1.0, 0.0, 1.9, 2.0, 2.5)] == [True, True, True, False, False]
    late = [SCRIPT.state(SCRIPT.duration + late).is_still for late in (-1.5, -0.5, 0.0, 9.0)]
    assert late == [False, True, True, True]


@pytest.mark.parametrize(
    ("moves", "text"),
    [
        ([{"wait": 1.0}, {"x": "far"}], r"entry 2: x = 'far': must be a number"),
        ([{"x": 1.0, "speed": 0}], r"entry 1: speed = 0: must be a number from 0.001 m/s"),
        ([{"x": 1.0, "sped": 1}], r"entry 1: sped = 1: no such parameter; did you mean speed\? there are x, y"),
        ([{"wait": -1}], r"entry 1: wait = -1: must be a number from 0 s"),
        ([{"wait": 1, "x": 2}], r"entry 1: x = 2: no such parameter; there are wait"),
        ([{"x": math.nan}], r"entry 1: x = nan"),
        ([{"x": 1e20}], r"entry 1: x = 1e\+20: must be a number from -100000000 to 100000000 m"),
        ([{}], r"entry 1: x, y, z, yaw_deg are all 0"),
        (["wait"], r"entry 1 = 'wait': must be keys and values"),
        ([], r"moves = \[\]: must be a list"),
        (None, r"moves = None: must be a list"),
    ],
)
def test_a_bad_entry_is_refused_with_its_number_key_and_what_is_allowed(moves, text):
    with pytest.raises(ParameterError, match=text):
        VehicleScript.from_yaml_data(moves)


TOURS = {name: load_script(ROOT / "yaml" / f"{name}_tour.yaml") for name in ("basin", "harbour", "tank")}
THESIS = load_script(ROOT / "yaml" / "thesis_moves.yaml")


def _whole_still_turns(script):
    """Return the numbers of the head's 16 s turns in which the vehicle never moves."""
    turns = range(int(script.duration // 16.0))
    return [turn for turn in turns if all(script.state(time).is_still for time in 16 * turn + np.linspace(0, 16, 121))]


@pytest.mark.parametrize(("name", "scans"), [("basin", 12), ("harbour", 10), ("tank", 4)])
def test_every_third_scan_of_a_tour_is_still(name, scans):
    assert _whole_still_turns(TOURS[name]) == [3 * scan for scan in range(scans)]


@pytest.mark.parametrize(("name", "distance"), [("basin", 2.0), ("harbour", 2.0), ("tank", 0.8)])
def test_a_tour_keeps_its_distance_from_everything_and_stays_between_surface_and_bottom(name, distance):
    path = np.array([TOURS[name].pose(time)[:3, 3] for time in np.arange(0.0, TOURS[name].duration, 0.2)])
    world = load_world(ROOT / "worlds" / f"{name}.sdf")
    assert min(_distance_to_polyline(path[:, :2], outline) for outline in world.outlines()) > distance
    assert path[:, 2].max() < -0.5
    assert RayCaster(world).hits(path, np.tile([0.0, 0.0, -1.0], (len(path), 1)))[0].min() > 0.6


def _distance_to_polyline(points, outline):
    """Return the least distance of any of the points (n, 2) from the line through the corners (m, 2)."""
    start, along = outline[:-1], np.diff(outline, axis=0)
    offsets = points[:, np.newaxis] - start
    share = np.clip((offsets * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(share[..., np.newaxis] * along - offsets, axis=2).min()


def test_the_basins_tour_brings_every_part_of_every_wall_within_40_m_of_a_still_scan():
    stops = np.array([TOURS["basin"].pose(48.0 * scan)[:2, 3] for scan in range(12)])
    around = np.arange(-60.0, 60.1, 1.0)
    across = np.arange(-25.0, 25.1, 1.0)
    walls = [(x, y) for x in around for y in (-25, 25)] + [(x, y) for y in across for x in (-60, 60)]
    assert max(np.linalg.norm(stops - wall, axis=1).min() for wall in walls) < 40.0


def test_the_thesis_moves_are_4_3_and_minus_8_m_of_odometry():
    assert _whole_still_turns(THESIS) == [0, 2, 4, 6]
    odometry = Odometry(OdometryParameters(scale_error=0.3), THESIS.pose(0.0), np.random.default_rng(0))
    times = 32.0 * np.arange(4)
    stops = [odometry.estimate(time, THESIS.state(time)).T_odom_base[:2, 3] for time in times]
    np.testing.assert_allclose(stops, [(0, 0), (4, 0), (4, 3), (-4, 3)], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (None, "No such file"),
        ("moves: [", "not yaml"),
        ("- wait: 1", "must hold lines of KEY: VALUE"),
        ("moves: [{wait: 1}]\nspeed: 2", "must hold the keys start and moves"),
        ("moves: [{wait: x}]", "entry 1: wait = 'x'"),
        ("moves: [{wait: 1}]\nstart: {depth: 2}", "start: depth = 2"),
    ],
)
def test_a_bad_file_is_refused_with_its_path(tmp_path, text, reason):
    path = tmp_path / "odd.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ParameterError, match=rf"odd\.yaml: .*{reason}"):
        load_script(path)
