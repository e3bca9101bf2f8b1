"""How far the echoes of one scan lie from those of another."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.distance import cdist

from mlsm_manager.self_check.compiled_distances import along_x, mean_distance

_MOST = 4.0


@given(st.integers(1, 60), st.integers(1, 60), st.integers(0, 2**32 - 1), st.sampled_from([1.0, 10.0]))
def test_the_mean_distance_is_that_of_the_nearest_places(targets, places, seed, size):
    rng = np.random.RandomState(seed)
    some, others = rng.uniform(-size, size, (targets, 2)), rng.uniform(-size, size, (places, 2))
    nearest = np.minimum(cdist(others, some).min(axis=1), _MOST)
    assert mean_distance(along_x(some), others, _MOST) == pytest.approx(nearest.mean(), abs=1e-12)


def test_places_of_equal_x_are_all_searched():
    wall = np.column_stack([np.ones(40), np.arange(40.0)])
    assert mean_distance(along_x(wall[::-1]), wall + np.array([0.5, 0.0]), _MOST) == pytest.approx(0.5)
