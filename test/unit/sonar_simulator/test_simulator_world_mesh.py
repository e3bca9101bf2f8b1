import math

import numpy as np

from node_support.geometry import pose_matrix
from sonar_simulator.world.world import MATERIALS, Shape, World, world_triangles

BOX = Shape("box", "box", pose_matrix((10, 0, -2)), (2.0, 4.0, 1.0), material=MATERIALS["steel"])
FLOOR = Shape("floor", "plane", pose_matrix((0, 0, -3)), (math.inf, math.inf))


def test_every_face_has_three_corners_and_their_colour():
    triangles = world_triangles(World.from_shapes("w", [BOX]))
    assert triangles.points.shape == (36, 3)
    assert triangles.colours.shape == (36, 4)
    np.testing.assert_allclose(triangles.colours[0], MATERIALS["steel"].colour)


def test_a_shape_with_a_colour_of_its_own_keeps_it():
    painted = Shape("b", "box", np.eye(4), (1.0, 1.0, 1.0), colour=(1.0, 0.0, 0.0, 0.5))
    np.testing.assert_allclose(world_triangles(World.from_shapes("w", [painted])).colours[5], (1.0, 0.0, 0.0, 0.5))


def test_a_plane_without_end_is_cut_to_the_rest_of_the_world():
    points = world_triangles(World.from_shapes("w", [FLOOR, BOX])).points[:6]
    np.testing.assert_allclose(points.min(axis=0), (9, -2, -3))
    np.testing.assert_allclose(points.max(axis=0), (11, 2, -3))


def test_planes_alone_are_shown_in_part():
    assert np.ptp(world_triangles(World.from_shapes("w", [FLOOR])).points, axis=0).tolist() == [100.0, 100.0, 0.0]
