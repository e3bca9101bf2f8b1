from pathlib import Path

import numpy as np
import pytest

from sonar_simulator.rays.ray_caster import RayCaster
from sonar_simulator.vehicle.odometry import Odometry, OdometryParameters
from sonar_simulator.vehicle.scripted_vehicle import ScriptError, load_script
from sonar_simulator.world.world_file import load_world

ROOT = Path(__file__).resolve().parents[3]
TOURS = {name: load_script(ROOT / "yaml" / f"{name}_tour.yaml") for name in ("basin", "harbour", "tank")}
THESIS = load_script(ROOT / "yaml" / "thesis_moves.yaml")


def _whole_still_turns(script):
    """Return the numbers of the head's 16 s turns in which the vehicle never moves."""
    turns = range(int(script.duration // 16.0))
    return [
        turn for turn in turns if all(script.state(time).is_still for time in 16.0 * turn + np.linspace(0, 16, 121))
    ]


@pytest.mark.parametrize(("name", "scans"), [("basin", 12), ("harbour", 10), ("tank", 4)])
def test_every_third_scan_of_a_tour_is_still(name, scans):
    assert _whole_still_turns(TOURS[name]) == [3 * scan for scan in range(scans)]


@pytest.mark.parametrize(("name", "distance"), [("basin", 2.0), ("harbour", 2.0), ("tank", 0.8)])
def test_a_tour_keeps_its_distance_from_everything(name, distance):
    times = np.arange(0.0, TOURS[name].duration, 0.2)
    path = np.array([TOURS[name].pose(time)[:2, 3] for time in times])
    world = load_world(ROOT / "worlds" / f"{name}.sdf").world
    for outline in world.outlines():
        assert _distance_to_polyline(path, outline) > distance


@pytest.mark.parametrize("name", ["basin", "harbour", "tank"])
def test_a_tour_stays_between_surface_and_bottom(name):
    times = np.arange(0.0, TOURS[name].duration, 1.0)
    path = np.array([TOURS[name].pose(time)[:3, 3] for time in times])
    caster = RayCaster(load_world(ROOT / "worlds" / f"{name}.sdf").world)
    below = caster.distances(path, np.tile([0.0, 0.0, -1.0], (len(path), 1)))
    assert path[:, 2].max() < -0.5
    assert below.min() > 0.6


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
        ("moves: [", "not yaml"),
        ("- wait: 1", "must hold the keys start and moves"),
        ("moves: [{wait: 1}]\nspeed: 2", "must hold the keys start and moves"),
        ("moves: [{wait: x}]", "entry 1: wait = 'x'"),
    ],
)
def test_a_bad_file_is_refused_with_its_path(tmp_path, text, reason):
    path = tmp_path / "odd.yaml"
    path.write_text(text)
    with pytest.raises(ScriptError, match=rf"odd\.yaml: .*{reason}"):
        load_script(path)


def test_a_missing_file_is_refused_with_its_path(tmp_path):
    with pytest.raises(ScriptError, match=r"none\.yaml: No such file"):
        load_script(tmp_path / "none.yaml")
