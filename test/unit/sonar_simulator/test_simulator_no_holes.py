"""Full scans begin with the nearest surface, as least distance programming finds it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from least_distance import nearest_range
from programs import ROOT

from node_support.geometry import pose_matrix
from sonar_simulator.echoes.beam_tracer import BeamPattern, BeamTracer, head_turns
from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.echoes.nearest_surface import NearestSurface
from sonar_simulator.echoes.ray_caster import RayCaster
from sonar_simulator.simulation.sonar_head import SonarHead, SonarParameters
from sonar_simulator.world.world import Shape, World
from sonar_simulator.world.world_file import load_world

pytestmark = pytest.mark.long

WORLDS = ROOT / "worlds"
NOISE_FREE = {
    "laser_cone": {"spread": 0.0, "noise_echoes": 0},
    "collision": {"spread": 0.0, "noise_echoes": 0, "increments": 0},
    "physical": {},
}
RANGES = {"basin": 50.0, "tank": 10.0, "harbour": 50.0}
# Level and tilted, in the open, close to things and under them.
POSES = {
    "basin": [((0, 0, -2), (0, 0, 0)), ((-31, 4.5, -3), (0, 0, 1)), ((20, -3, -1.5), (0.1, 0.3, 0.5))],
    "tank": [((0, 0, -1), (0, 0, 0)), ((1, 0.5, -0.5), (0, 0.4, 0.3))],
    "harbour": [((0, 0, -2), (0, 0, 0)), ((-14, -3, -3), (0.1, -0.2, 1)), ((9, 3, -1), (0, 0.3, 0))],
}
_HEAD = SonarHead(120, 16.0)
ANGLES = np.array([_HEAD.angle(beam) for beam in range(120)])


def differences(name, model_name, rays=(9, 5)):
    """Return by how many bins the first echoes of full scans from all poses lie beyond the nearest surface.

    A beam that is silent counts as one whose first echo is in the bin after the last, on both sides.
    """
    world = load_world(WORLDS / f"{name}.sdf")
    model = make_echo_model(model_name, {**NOISE_FREE[model_name], "max_range": RANGES[name]})
    pattern = model.pattern(SonarParameters(ray_rows=rays[0], ray_columns=rays[1]).pattern())
    tracer = BeamTracer(RayCaster(world), pattern, model.mirrors)
    found, expected = [], []
    for xyz, rpy in POSES[name]:
        T_world_sonar = pose_matrix(xyz, rpy)
        found.append(_first_bins(tracer, model, T_world_sonar))
        expected.append([_expected_bin(world, T_world_sonar, angle, pattern.planes(), model) for angle in ANGLES])
    return (np.array(found) - np.array(expected)).ravel()


def _first_bins(tracer, model, T_world_sonar):
    rng = np.random.default_rng(0)
    poses = np.repeat(T_world_sonar[np.newaxis], len(ANGLES), axis=0)
    contacts = tracer.contacts(poses, ANGLES, model.max_range, rng)
    # The weakest echoes of the physical model are below what its head can show: they are looked for before that.
    heard = (model.intensities(contacts) if hasattr(model, "intensities") else model.echoes(contacts, rng)) > 0
    return np.where(heard.any(axis=1), heard.argmax(axis=1), model.bins)


def _expected_bin(world, T_world_sonar, angle, planes, model):
    T_world_beam = T_world_sonar.copy()
    T_world_beam[:3, :3] = T_world_sonar[:3, :3] @ head_turns([angle])[0]
    nearest = nearest_range(world, T_world_beam, planes, model.max_range)
    return model.bins if math.isinf(nearest) else math.ceil(nearest * model.bins / model.max_range) - 1


pytest.importorskip("embreex")
FAN = BeamPattern(math.radians(22.0), math.radians(2.5), 9, 5).planes()


@pytest.mark.parametrize("model", ["laser_cone", "collision", "physical"])
@pytest.mark.parametrize("world", RANGES)
def test_every_beam_of_a_full_scan_begins_with_the_nearest_surface(world, model):
    assert np.abs(differences(world, model)).max() <= 1


def test_a_rope_between_the_rays_is_heard():
    rope = Shape("rope", "cylinder", pose_matrix((40.0, 0.3, 0.0)), (0.01, 2.0))
    wall = Shape("wall", "box", pose_matrix((45.5, 0.0, 0.0)), (1.0, 40.0, 40.0))
    world = World.from_shapes("w", [wall, rope])
    points, faces = NearestSurface(world).find(np.zeros((1, 3)), np.eye(3)[np.newaxis], FAN, np.array([50.0]))
    assert np.linalg.norm(points[0]) == pytest.approx(math.hypot(40.0, 0.3) - 0.01, abs=1e-3)
    assert faces[0] >= 12


@given(
    st.tuples(st.floats(2.0, 30.0), st.floats(-3.0, 3.0), st.floats(-5.0, 5.0)),
    st.tuples(*(st.floats(-math.pi, math.pi) for _ in range(3))),
    st.tuples(*(st.floats(0.05, 2.0) for _ in range(3))),
)
def test_the_nearest_point_of_a_box_in_a_beam_is_the_solution_of_the_least_distance_program(place, turn, size):
    box = Shape("box", "box", pose_matrix(place, turn), size)
    inside = np.abs(box.pose[:3, :3].T @ -box.pose[:3, 3]) <= np.array(size) / 2.0
    if inside.all():
        return
    world = World.from_shapes("w", [box])
    points, _ = NearestSurface(world).find(np.zeros((1, 3)), np.eye(3)[np.newaxis], FAN, np.array([50.0]))
    assert np.linalg.norm(points[0]) == pytest.approx(nearest_range(world, np.eye(4), FAN, 50.0), abs=1e-5)


def test_nothing_in_the_beam_is_nothing_found():
    world = World.from_shapes("w", [Shape("box", "box", pose_matrix((0.0, 10.0, 0.0)), (1.0, 1.0, 1.0))])
    points, faces = NearestSurface(world).find(np.zeros((1, 3)), np.eye(3)[np.newaxis], FAN, np.array([50.0]))
    assert np.isinf(points).all()
    assert faces[0] == -1


def test_what_is_beyond_the_limit_is_not_looked_for():
    world = World.from_shapes("w", [Shape("box", "box", pose_matrix((10.0, 0.0, 0.0)), (1.0, 1.0, 1.0))])
    assert NearestSurface(world).find(np.zeros((1, 3)), np.eye(3)[np.newaxis], FAN, np.array([9.0]))[1][0] == -1
