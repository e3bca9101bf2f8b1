import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from node_support.geometry import pose_matrix
from sonar_simulator.rays.ray_caster import RayCaster
from sonar_simulator.world.world import MissingPackageError, Shape, World

HALF = np.array([60.0, 25.0, 5.0])
ROOM = RayCaster(World.from_shapes("room", [Shape("room", "box", np.eye(4), tuple(2.0 * HALF))]))


def _directions(bearings, elevations):
    level = np.cos(elevations)
    return np.stack([level * np.cos(bearings), level * np.sin(bearings), np.sin(elevations)], axis=-1)


@given(st.tuples(*(st.floats(-0.9, 0.9) for _ in range(3))), st.floats(-np.pi, np.pi), st.floats(-1.5, 1.5))
def test_from_inside_a_room_every_ray_meets_the_wall_that_geometry_gives(place, bearing, elevation):
    origin = np.array(place) * HALF
    direction = _directions(bearing, elevation)
    with np.errstate(divide="ignore", over="ignore"):
        expected = ((HALF - np.sign(direction) * origin) / np.abs(direction)).min()
    found = ROOM.distances(origin[np.newaxis], direction[np.newaxis])
    np.testing.assert_allclose(found, [expected], rtol=1e-5)


def test_no_ray_slips_through_the_edges_between_triangles():
    corner = HALF / np.linalg.norm(HALF)
    along = np.linspace(0.0, 1.0, 20001)[:, np.newaxis]
    diagonal = (1 - along) * (60.0, -25.0, -5.0) + along * (60.0, 25.0, 5.0)
    rays = np.vstack([diagonal / np.linalg.norm(diagonal, axis=1, keepdims=True), corner])
    assert np.isfinite(ROOM.distances(np.zeros_like(rays), rays)).all()


def test_a_cylinder_is_met_at_its_radius():
    caster = RayCaster(World.from_shapes("w", [Shape("b", "cylinder", pose_matrix((10, 0, 0)), (0.5, 4.0))]))
    assert caster.distances(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]))[0] == pytest.approx(9.5, abs=1e-3)


def test_a_ray_that_hits_nothing_is_infinitely_long():
    caster = RayCaster(World.from_shapes("w", [Shape("b", "sphere", pose_matrix((10, 0, 0)), (1.0,))]))
    assert caster.distances(np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]))[0] == np.inf


def test_no_rays_have_no_distances():
    assert ROOM.distances(np.empty((0, 3)), np.empty((0, 3))).shape == (0,)


def test_without_embreex_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", None)
    expected = r"it casts the simulator's rays; install it: \S+ -m pip install embreex$"
    with pytest.raises(MissingPackageError, match=expected):
        RayCaster(World.from_shapes("w", [Shape("b", "sphere", np.eye(4), (1.0,))]))
