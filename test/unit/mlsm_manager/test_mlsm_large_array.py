"""Arrays that grow without being copied."""

import numpy as np
import pytest

from mlsm_manager.surface_map.large_array import LargeArray

SMALL, LARGE = 1000, 1_000_000


@pytest.mark.parametrize("length", [SMALL, LARGE])
@pytest.mark.parametrize(("shape", "dtype"), [((3,), np.float64), ((), np.int32)])
def test_what_was_written_stays_when_it_grows(length, shape, dtype):
    array = LargeArray(length, shape, dtype)
    written = np.arange(length * int(np.prod(shape, dtype=int)), dtype=dtype).reshape(length, *shape)
    array.values[:] = written
    for longer in (length + 1, 3 * length, 40 * length):
        array.reserve(longer)
        assert len(array.values) >= longer
        np.testing.assert_array_equal(array.values[:length], written)


def test_it_at_least_doubles_and_never_shrinks():
    array = LargeArray(SMALL, (), np.int32)
    array.reserve(SMALL + 1)
    assert len(array.values) == 2 * SMALL
    array.reserve(SMALL)
    assert len(array.values) == 2 * SMALL


def test_whoever_holds_an_old_array_keeps_what_was_in_it():
    array = LargeArray(LARGE, (2,), np.float64)
    array.values[:] = 1.0
    held = array.values
    array.reserve(2 * LARGE)
    array.values[:] = 2.0
    assert held.shape == (LARGE, 2)
    assert (held == 1.0).all()


def test_a_large_array_can_be_written_into_everywhere_after_it_grew():
    array = LargeArray(LARGE, (), np.float64)
    array.reserve(5 * LARGE)
    array.values[:] = 7.0
    assert array.values.sum() == 7.0 * len(array.values)
