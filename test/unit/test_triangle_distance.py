"""Distances from triangles, against the nearest of many points on them."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from thesis_results.survey import triangle_distances

STEPS = 30


def points_on(corners):
    """Return points (k, 3) all over the triangles with corners (m, 3, 3)."""
    u, v = (part.ravel() for part in np.meshgrid(*[np.linspace(0.0, 1.0, STEPS + 1)] * 2))
    inside = u + v <= 1.0 + 1e-9
    weights = np.column_stack([1.0 - u - v, u, v])[inside]
    return np.concatenate([weights @ triangle for triangle in corners])


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_no_point_of_the_triangles_is_nearer_and_one_is_as_near(seed):
    rng = np.random.RandomState(seed)
    corners, points = rng.uniform(-2.0, 2.0, (4, 3, 3)), rng.uniform(-4.0, 4.0, (20, 3))
    sampled = np.linalg.norm(points[:, np.newaxis] - points_on(corners), axis=2).min(axis=1)
    found = triangle_distances(corners, points)
    assert (found <= sampled + 1e-9).all()
    longest_step = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() / STEPS
    assert (sampled - found <= longest_step).all()


def test_a_triangle_without_area_is_its_longest_edge():
    corners = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]]])
    np.testing.assert_allclose(triangle_distances(corners, np.array([[2.0, 0.5, 0.0], [5.0, 0.0, 0.0]])), [0.5, 2.0])


def test_no_points_have_no_distances():
    assert triangle_distances(np.zeros((1, 3, 3)), np.empty((0, 3))).shape == (0,)
