"""Compiled insertion makes the same map as numpy, to the last bit and in the same order."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mlsm_manager.surface_map.insertion import InsertionKernel
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap

pytest.importorskip("numba")
HEIGHTS = st.one_of(st.floats(-5.0, 5.0), st.integers(-20, 20).map(lambda quarters: quarters * 0.25))
POINTS = st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), HEIGHTS, st.floats(0.0, 255.0))


def _maps(resolution):
    return [MultiLevelSurfaceMap(resolution, kernel=kernel) for kernel in InsertionKernel]


def _assert_same(maps):
    first, second = (surface_map.blocks for surface_map in maps)
    assert first.rows.tobytes() == second.rows.tobytes()
    assert first.crossed.tobytes() == second.crossed.tobytes()
    assert maps[0].take_changed_tiles().tolist() == maps[1].take_changed_tiles().tolist()


@given(st.lists(st.lists(POINTS, min_size=1, max_size=60), min_size=1, max_size=4), st.sampled_from([0.1, 0.5, 1.0]))
@settings(max_examples=60, deadline=None)
def test_batches_of_any_points_make_the_same_rows(batches, resolution):
    maps = _maps(resolution)
    for batch in batches:
        for surface_map in maps:
            surface_map.insert(np.array(batch))
        _assert_same(maps)


@pytest.mark.parametrize("extent", [1.0, 10.0, 100.0])
def test_many_scans_make_the_same_rows(extent):
    maps, rng = _maps(0.5), np.random.RandomState(0)
    for _ in range(20):
        points = np.column_stack([rng.uniform(-extent, extent, (2000, 3)), rng.uniform(0, 127, 2000)])
        for surface_map in maps:
            surface_map.insert(points)
    _assert_same(maps)


def test_a_column_of_thousands_makes_the_same_rows():
    maps, rng = _maps(0.5), np.random.RandomState(0)
    for _ in range(3):
        column = np.column_stack([np.zeros((3000, 2)), rng.uniform(-900.0, 900.0, 3000), np.ones(3000)])
        for surface_map in maps:
            surface_map.insert(column)
    _assert_same(maps)
