import math

import numpy as np
import pytest
from full_scan import RANGES, differences
from hypothesis import given, settings
from hypothesis import strategies as st
from least_distance import nearest_range

from node_support.geometry import pose_matrix
from sonar_simulator.rays.beam_pattern import BeamPattern
from sonar_simulator.rays.nearest_surface import NearestSurface
from sonar_simulator.world.world import Shape, World

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


@settings(max_examples=50)
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
