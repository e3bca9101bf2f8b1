"""Rays, and what they meet off mirrors."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from node_support.geometry import pose_matrix
from sonar_simulator.echoes.beam_tracer import BeamPattern, BeamTracer
from sonar_simulator.echoes.ray_caster import Mirrors, RayCaster, legs
from sonar_simulator.world.world import MATERIALS, Shape, World

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
    found = ROOM.hits(origin[np.newaxis], direction[np.newaxis])[0]
    np.testing.assert_allclose(found, [expected], rtol=1e-5)


def test_no_ray_slips_through_the_edges_between_triangles():
    corner = HALF / np.linalg.norm(HALF)
    along = np.linspace(0.0, 1.0, 20001)[:, np.newaxis]
    diagonal = (1 - along) * (60.0, -25.0, -5.0) + along * (60.0, 25.0, 5.0)
    rays = np.vstack([diagonal / np.linalg.norm(diagonal, axis=1, keepdims=True), corner])
    assert np.isfinite(ROOM.hits(np.zeros_like(rays), rays)[0]).all()


def test_a_cylinder_is_met_at_its_radius():
    caster = RayCaster(World.from_shapes("w", [Shape("b", "cylinder", pose_matrix((10, 0, 0)), (0.5, 4.0))]))
    assert caster.hits(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]))[0][0] == pytest.approx(9.5, abs=1e-3)


def test_a_ray_that_hits_nothing_is_infinitely_long_and_no_rays_have_no_distances():
    caster = RayCaster(World.from_shapes("w", [Shape("b", "sphere", pose_matrix((10, 0, 0)), (1.0,))]))
    assert caster.hits(np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]))[0][0] == np.inf
    assert caster.hits(np.empty((0, 3)), np.empty((0, 3)))[0].shape == (0,)


STEEL, ROCK = MATERIALS["steel"], MATERIALS["rock"]


def _wall(x, material=STEEL):
    return Shape("wall", "box", pose_matrix((x, 0, 0)), (1.0, 100.0, 100.0), material)


CORRIDOR = RayCaster(World.from_shapes("w", [_wall(5.5), _wall(-3.5)]))
AHEAD = np.array([[1.0, 0.0, 0.0]])


def _legs(caster, mirrors, origin=(0.0, 0.0, -2.0), direction=AHEAD, max_range=50.0):
    return list(legs(caster, np.array([origin]), direction, mirrors, max_range))


def test_between_two_walls_a_ray_meets_them_in_turn_and_every_mirror_takes_its_share_there_and_back():
    ways, share = _legs(CORRIDOR, Mirrors(bounces=3)), (STEEL.reflection**2 * STEEL.mirror) ** 2
    assert [leg.ranges[0] for leg in ways] == pytest.approx([5.0, 13.0, 21.0, 29.0], abs=0.01)
    assert [leg.left[0] for leg in ways] == pytest.approx([1.0, share, share**2, share**3])


def test_a_rough_wall_is_no_mirror():
    caster = RayCaster(World.from_shapes("w", [_wall(5.5, ROCK), _wall(-3.5, ROCK)]))
    assert np.isinf(_legs(caster, Mirrors(bounces=1))[1].ranges[0])


def test_an_echo_off_an_oblique_mirror_comes_from_where_the_mirror_sends_the_sound():
    oblique = Shape("m", "box", pose_matrix((5.0, 0, 0), (0, 0, math.pi / 4)), (0.001, 4.0, 4.0), STEEL)
    target = Shape("t", "box", pose_matrix((5.0, 7.5, 0)), (4.0, 1.0, 100.0), STEEL)
    below = Shape("t", "box", pose_matrix((5.0, -7.5, 0)), (4.0, 1.0, 100.0), STEEL)
    caster = RayCaster(World.from_shapes("w", [oblique, target, below]))
    assert _legs(caster, Mirrors(bounces=1), origin=(0.0, 0.0, 0.0))[1].ranges[0] == pytest.approx(12.0, abs=0.02)


def test_a_ray_is_given_up_beyond_the_range():
    assert np.isinf(_legs(CORRIDOR, Mirrors(bounces=2), max_range=10.0)[2].ranges[0])


def test_the_waters_surface_throws_rays_back_down_and_gives_no_echo_itself():
    floor = Shape("floor", "box", pose_matrix((0, 0, -5.5)), (200.0, 200.0, 1.0))
    caster = RayCaster(World.from_shapes("w", [floor]))
    rising = np.array([[math.cos(0.2), 0.0, math.sin(0.2)]])
    up, down = _legs(caster, Mirrors(bounces=1, surface=True, surface_loss=0.5), direction=rising)
    assert np.isinf(up.ranges[0])
    assert down.ranges[0] == pytest.approx((2.0 + 5.0) / math.sin(0.2), rel=1e-3)
    assert down.left[0] == pytest.approx(0.25)


def test_what_stands_above_the_water_is_not_heard_when_the_surface_is_a_mirror():
    tower = Shape("tower", "box", pose_matrix((10.0, 0, 3.0)), (1.0, 4.0, 4.0))
    caster = RayCaster(World.from_shapes("w", [tower]))
    fan = BeamPattern(math.radians(60.0), math.radians(3.0), 20, 3)
    poses = pose_matrix((0, 0, -0.5))[np.newaxis]
    ranges = [
        BeamTracer(caster, fan, mirrors).contacts(poses, np.zeros(1), 50.0, np.random.default_rng(0)).ranges.min()
        for mirrors in (Mirrors(), Mirrors(bounces=1, surface=True))
    ]
    assert ranges[0] < 10.0
    assert math.isinf(ranges[1])


def test_side_lobes_look_all_around_and_leave_the_nearest_surface_of_the_beam_alone():
    behind = RayCaster(World.from_shapes("w", [_wall(20.5), _wall(-3.5)]))
    pattern = BeamPattern(0.4, 0.05, 5, 3, side_rays=40)
    contacts = BeamTracer(behind, pattern).contacts(np.eye(4)[np.newaxis], np.zeros(1), 50.0, np.random.default_rng(0))
    assert contacts.ranges[0, 0] == pytest.approx(20.0, abs=1e-3)
    assert contacts.ranges[0, 16:].min() < 4.0
    assert contacts.shares[0, 1:16].sum() == pytest.approx(1.0)
    assert contacts.shares[0, 16:].sum() == pytest.approx(2.0 * math.pi / 0.05)
