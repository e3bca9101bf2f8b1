"""The head: its rays and beams in a world, and the echoes that it gives emulated heads."""

import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from programs import ROOT

from node_support.geometry import pose_matrix
from node_support.parameters import ParameterError
from sonar_simulator.echoes.beam_tracer import BeamPattern, head_turns
from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.echoes.ray_caster import RayCaster
from sonar_simulator.simulation.sonar_head import Sonar, SonarHead, SonarParameters, WorldEchoes, world_echoes
from sonar_simulator.world.world import Shape, World
from sonar_simulator.world.world_file import load_world

PATTERN = BeamPattern(math.radians(22.0), math.radians(2.5), 50, 10)
HEAD = SonarHead(120, 16.0)
BASIN_FILE = ROOT / "worlds" / "basin.sdf"
BASIN = load_world(BASIN_FILE)
WALLS = World.from_shapes("walls", [shape for shape in BASIN.shapes if "wall" in shape.name])


def _sonar(world, seed=0, pattern=PATTERN, **values):
    return Sonar(RayCaster(world), pattern, make_echo_model("laser_cone", values), np.random.default_rng(seed))


def test_rays_are_unit_vectors_one_in_every_stratum_of_the_opening():
    (rays,) = PATTERN.sample(1, np.random.default_rng(0))
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1.0)
    row = np.floor((np.degrees(np.arcsin(rays[:, 2])) / 22.0 + 0.5) * 50)
    column = np.floor((np.degrees(np.arctan2(rays[:, 1], rays[:, 0])) / 2.5 + 0.5) * 10)
    assert set(zip(row, column)) == {(i, j) for i in range(50) for j in range(10)}


def test_every_beam_has_a_jitter_of_its_own():
    first, second = PATTERN.sample(2, np.random.default_rng(0))
    assert not (first[:, 2] == second[:, 2]).any()


def test_rays_turn_counter_clockwise_with_the_head():
    (rays,) = PATTERN.sample(1, np.random.default_rng(0)) @ head_turns(np.array([math.pi / 2])).transpose(0, 2, 1)
    np.testing.assert_allclose(rays.mean(axis=0)[:2], (0.0, 1.0), atol=0.01)


def test_the_head_starts_ahead_and_steps_3_degrees_counter_clockwise_in_16_s():
    assert [math.degrees(HEAD.angle(beam)) for beam in (0, 1, 60, 119, 120)] == pytest.approx([0, 3, 180, -3, 0])
    assert [HEAD.time(beam) for beam in (0, 1, 120)] == pytest.approx([0.0, 16.0 / 120, 16.0])


def test_a_tilted_sonar_looks_along_its_own_plane():
    world = World.from_shapes("w", [Shape("b", "box", pose_matrix((0, 0, -10)), (50.0, 50.0, 1.0))])
    sonar = _sonar(world, spread=0.0, noise_echoes=0)
    down = pose_matrix((0, 0, 0), (0.0, math.pi / 2, 0.0))
    assert np.argmax(sonar.ping(down, 0.0) > 0) == pytest.approx(95, abs=1)
    assert not sonar.ping(pose_matrix((0, 0, 0)), 0.0).any()


def test_parameters_give_pattern_and_range_resolution():
    assert SonarParameters().pattern() == PATTERN
    assert _sonar(WALLS).range_resolution == 0.1
    assert _sonar(WALLS).max_range == 50.0


WALL = World.from_shapes("wall", [Shape("wall", "box", pose_matrix((10.5, 0, 0)), (1, 40, 40))])


def ping(angle=0.0, bin_count=500, max_range=20, gain=0):
    return SimpleNamespace(angle=angle, bin_count=bin_count, max_range=max_range, gain_db=gain)


def head_in(world_file):
    place = {"x": 0.0, "y": 0.0, "z": -2.0, "yaw_deg": 0.0}
    return SimpleNamespace(world_file=world_file, **place, beam_height_deg=22.0, beam_width_deg=2.5, seed=1)


@pytest.fixture
def source():
    return WorldEchoes(WALL, lambda: np.eye(4), seed=1)


def mean_range(echoes, max_range):
    """Return the mean range of the strong echoes; those of noise are weaker."""
    strengths = np.frombuffer(echoes, dtype=np.uint8).astype(float)
    strengths[strengths < 0.9 * strengths.max()] = 0.0
    return np.average((np.arange(len(strengths)) + 0.5) * max_range / len(strengths), weights=strengths)


@pytest.mark.parametrize(("bin_count", "max_range"), [(500, 20), (252, 20), (500, 50)])
def test_a_wall_is_heard_where_it_stands_whatever_the_head_is_told(source, bin_count, max_range):
    echoes = source(ping(bin_count=bin_count, max_range=max_range))
    assert len(echoes) == bin_count
    assert mean_range(echoes, max_range) == pytest.approx(10.1, abs=0.5)


@pytest.mark.parametrize("where", [{"angle": math.pi}, {"max_range": 5}])
def test_open_water_or_a_wall_out_of_reach_is_silent(source, where):
    assert not any(source(ping(**where)))


def test_less_gain_makes_weaker_echoes(source):
    assert sum(source(ping(gain=-12))) < 0.5 * sum(source(ping()))


def test_the_head_hears_from_where_it_was_placed():
    place = pose_matrix((5.0, 0.0, 0.0), (0.0, 0.0, math.pi))
    source = WorldEchoes(WALL, lambda: place, seed=1)
    assert mean_range(source(ping(angle=math.pi)), 20) == pytest.approx(5.0, abs=0.5)


def test_a_head_that_moves_hears_from_where_it_is_at_each_ping():
    places = iter([pose_matrix((5.0, 0.0, 0.0)), None, pose_matrix((2.0, 0.0, 0.0))])
    source = WorldEchoes(WALL, lambda: next(places), seed=1)
    near, nowhere, far = (source(ping()) for _ in range(3))
    assert [mean_range(near, 20), mean_range(far, 20)] == pytest.approx([5.1, 8.1], abs=0.5)
    assert nowhere == bytes(500)


def test_a_world_that_cannot_be_read_is_a_bad_parameter():
    with pytest.raises(ParameterError, match=r"world_file.*none\.sdf"):
        world_echoes(head_in("none.sdf"))


def test_without_the_ray_caster_the_head_is_refused_with_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", None)
    basin = str(BASIN_FILE)
    with pytest.raises(ParameterError, match=r"it casts the simulator's rays; install it: \S+ -m pip install embreex$"):
        world_echoes(head_in(basin))
