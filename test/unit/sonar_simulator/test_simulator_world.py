"""Shapes, their outlines and triangles, and worlds of them."""

import math

import numpy as np
import pytest

from node_support.geometry import pose_matrix
from sonar_simulator.world.world import MATERIALS, Shape, World, world_triangles

FLOOR = Shape("floor", "box", pose_matrix((0, 0, -6)), (122.0, 52.0, 1.0))
WALL = Shape("wall", "box", pose_matrix((60.5, 0, -2.5)), (1.0, 52.0, 6.0))


def outline_of(kind, size, *pose):
    (outline,) = World.from_shapes("w", [Shape("s", kind, pose_matrix(*pose), size)]).outlines()
    return outline


def test_the_outline_of_a_wall_is_its_closed_rectangle_and_the_floor_has_none():
    (outline,) = World.from_shapes("w", [WALL, FLOOR]).outlines()
    assert outline.shape == (5, 2)
    np.testing.assert_array_equal(outline[0], outline[-1])
    assert {tuple(corner) for corner in outline} == {(60, -26), (60, 26), (61, -26), (61, 26)}


def test_the_outline_of_a_buoy_is_a_circle_and_a_lying_pipe_is_as_long_as_from_above():
    buoy = outline_of("cylinder", (0.5, 5.0), (3, 4, 0))
    np.testing.assert_allclose(np.hypot(buoy[:, 0] - 3, buoy[:, 1] - 4), 0.5)
    pipe = outline_of("cylinder", (0.25, 8.0), (0, 0, 0), (0, np.pi / 2, 0))
    np.testing.assert_allclose(np.ptp(pipe, axis=0), (8.0, 0.5))


def test_joined_faces_point_to_the_vertices_of_their_own_shape():
    world = World.from_shapes("w", [FLOOR, WALL])
    last = world.vertices[world.faces[len(world.faces) // 2 :]]
    assert last[..., 0].min() == 60.0


@pytest.mark.parametrize(
    ("kind", "size", "volume"),
    [("box", (2.0, 3.0, 4.0), 24.0), ("cylinder", (0.5, 4.0), np.pi), ("sphere", (1.0,), 4.0 * np.pi / 3.0)],
)
def test_a_primitive_is_closed_and_holds_its_volume(kind, size, volume):
    vertices, faces = Shape("s", kind, pose_matrix((1, 2, 3), (0.1, 0.2, 0.3)), size).triangles()
    a, b, c = (vertices[faces[:, corner]] - (1, 2, 3) for corner in range(3))
    # A closed surface seen from inside: the cones over its faces fill it, whichever way the faces are wound.
    assert np.abs(np.einsum("ij,ij->i", a, np.cross(b, c))).sum() / 6.0 == pytest.approx(volume, rel=0.01)


BOX = Shape("box", "box", pose_matrix((10, 0, -2)), (2.0, 4.0, 1.0), material=MATERIALS["steel"])
ENDLESS = Shape("floor", "plane", pose_matrix((0, 0, -3)), (math.inf, math.inf))


def test_every_face_has_three_corners_and_their_colour():
    points, colours = world_triangles(World.from_shapes("w", [BOX]))
    assert (points.shape, colours.shape) == ((36, 3), (36, 4))
    np.testing.assert_allclose(colours[0], MATERIALS["steel"].colour)


def test_a_shape_with_a_colour_of_its_own_keeps_it():
    painted = Shape("b", "box", np.eye(4), (1.0, 1.0, 1.0), colour=(1.0, 0.0, 0.0, 0.5))
    np.testing.assert_allclose(world_triangles(World.from_shapes("w", [painted]))[1][5], (1.0, 0.0, 0.0, 0.5))


def test_a_plane_without_end_is_cut_to_the_rest_of_the_world():
    points = world_triangles(World.from_shapes("w", [ENDLESS, BOX]))[0][:6]
    np.testing.assert_allclose(points.min(axis=0), (9, -2, -3))
    np.testing.assert_allclose(points.max(axis=0), (11, 2, -3))


def test_planes_alone_are_shown_in_part():
    assert np.ptp(world_triangles(World.from_shapes("w", [ENDLESS]))[0], axis=0).tolist() == [100.0, 100.0, 0.0]
