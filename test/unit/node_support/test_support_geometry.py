"""Geometry comes out alike in every run, so that a recording gives the same map twice."""

import numpy as np
import pytest

from node_support.geometry import bearings_of, rotated


@pytest.mark.parametrize(
    "function", [lambda table: bearings_of(table[:, 5:]), lambda table: rotated(table[:, :2], table[:, 6])]
)
def test_equal_vectors_give_equal_bits_wherever_they_lie_in_memory(function):
    rng = np.random.RandomState(0)
    table = rng.normal(size=(1000, 12))
    expected = function(table)
    for _ in range(1000):
        count = rng.randint(900, 1000)
        held = [np.empty(size) for size in rng.randint(1, 300, rng.randint(20))]
        np.testing.assert_array_equal(function(table[:count].copy()), expected[:count])
        del held
