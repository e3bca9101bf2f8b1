"""The order by cell and height is that of numpy's general sort."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlsm_manager.surface_map.cell_index import cell_keys
from mlsm_manager.surface_map.cell_order import cell_order

POINT = st.tuples(st.integers(-3, 3), st.integers(-3, 3), st.sampled_from([-1.0, -0.0, 0.0, 0.5, 2.0]))


def assert_sorted(cells, heights):
    keys = cell_keys(np.array(cells, dtype=np.int64).reshape(-1, 2))
    np.testing.assert_array_equal(cell_order(keys, heights), np.lexsort((heights, keys)))


@given(st.lists(POINT, max_size=60))
def test_equal_cells_and_heights_stay_in_their_order(points):
    assert_sorted([point[:2] for point in points], np.array([point[2] for point in points]))


@pytest.mark.parametrize("reach", [1, 100, 300, 20_000, 2_000_000])
def test_cells_near_and_far(reach):
    rng = np.random.RandomState(reach)
    assert_sorted(rng.randint(-reach, reach, (3000, 2)), rng.uniform(-5.0, 0.0, 3000))
