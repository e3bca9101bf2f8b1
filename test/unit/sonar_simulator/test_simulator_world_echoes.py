import math
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from node_support.geometry import pose_matrix
from node_support.parameters import ParameterError
from sonar_simulator.simulation.sonar_head import WorldEchoes, world_echoes
from sonar_simulator.world.world import Shape, World

pytest.importorskip("embreex")

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
    echoes = source.echoes(ping(bin_count=bin_count, max_range=max_range))
    assert len(echoes) == bin_count
    assert mean_range(echoes, max_range) == pytest.approx(10.1, abs=0.5)


def test_open_water_is_silent(source):
    assert not any(source.echoes(ping(angle=math.pi)))


def test_a_wall_out_of_reach_is_silent(source):
    assert not any(source.echoes(ping(max_range=5)))


def test_less_gain_makes_weaker_echoes(source):
    assert sum(source.echoes(ping(gain=-12))) < 0.5 * sum(source.echoes(ping()))


def test_the_head_hears_from_where_it_was_placed():
    place = pose_matrix((5.0, 0.0, 0.0), (0.0, 0.0, math.pi))
    source = WorldEchoes(WALL, lambda: place, seed=1)
    assert mean_range(source.echoes(ping(angle=math.pi)), 20) == pytest.approx(5.0, abs=0.5)


def test_a_head_that_moves_hears_from_where_it_is_at_each_ping():
    places = iter([pose_matrix((5.0, 0.0, 0.0)), None, pose_matrix((2.0, 0.0, 0.0))])
    source = WorldEchoes(WALL, lambda: next(places), seed=1)
    near, nowhere, far = (source.echoes(ping()) for _ in range(3))
    assert [mean_range(near, 20), mean_range(far, 20)] == pytest.approx([5.1, 8.1], abs=0.5)
    assert nowhere == bytes(500)


def test_a_world_that_cannot_be_read_is_a_bad_parameter():
    with pytest.raises(ParameterError, match=r"world_file.*none\.sdf"):
        world_echoes(head_in("none.sdf"))


def test_without_the_ray_caster_the_head_is_refused_with_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", None)
    basin = str(Path(__file__).resolve().parents[3] / "worlds" / "basin.sdf")
    with pytest.raises(ParameterError, match="-m pip install embreex"):
        world_echoes(head_in(basin))
