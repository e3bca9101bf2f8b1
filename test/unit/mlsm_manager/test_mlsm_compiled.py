"""Compiled insertion makes the same map as numpy, to the last bit and in the same order."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.kernels import Kernel

MODULES = [
    pytest.importorskip(f"mlsm_manager.surface_map.compiled_{name}", reason="numba is not installed")
    for name in ("grouping", "merging", "index")
]
# One byte each for x, y, height and strength: hypothesis draws and shrinks them ten times as fast as floats.
BATCHES = st.lists(st.binary(min_size=4, max_size=240), min_size=1, max_size=4)


def _maps(resolution):
    return [MultiLevelSurfaceMap(resolution, kernel=kernel) for kernel in Kernel]


def _assert_same(maps):
    first, second = (surface_map.blocks for surface_map in maps)
    assert first.rows.tobytes() == second.rows.tobytes()
    assert first.crossed.tobytes() == second.crossed.tobytes()
    assert maps[0].take_changed_tiles().tolist() == maps[1].take_changed_tiles().tolist()


def _points(drawn):
    """Return (n, 4) points up to 1.5 m aside; half the heights lie on multiples of 0.25 m, the others anywhere."""
    x, y, z, strength = np.frombuffer(drawn[: len(drawn) // 4 * 4], np.uint8).reshape(-1, 4).T.astype(np.float64)
    heights = np.where(z < 128, (z - 64.0) * 0.25, (z - 192.0) / 12.7)
    return np.column_stack([x / 85.0 - 1.5, y / 85.0 - 1.5, heights, strength])


@given(BATCHES, st.sampled_from([0.1, 0.5, 1.0]))
@settings(max_examples=100)
def test_batches_of_any_points_make_the_same_rows(batches, resolution):
    maps = _maps(resolution)
    for batch in batches:
        for surface_map in maps:
            surface_map.insert(_points(batch))
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


def test_points_that_no_map_takes_are_counted_alike():
    points = np.zeros((8, 4))
    points[1, 0], points[2, 2], points[3, 3], points[4, 3] = np.nan, np.inf, np.nan, -np.inf
    points[5, 1], points[6, 2] = -10000.1, 10000.0
    maps = _maps(0.5)
    reports = [surface_map.insert(points) for surface_map in maps]
    assert reports[0] == reports[1]
    assert (reports[0].inserted, reports[0].not_finite, reports[0].outside) == (3, 4, 1)
    _assert_same(maps)


@pytest.mark.parametrize("number", [0, 1])
def test_a_batch_without_a_point_that_fits_changes_no_map(number):
    maps = _maps(0.5)
    for surface_map in maps:
        surface_map.insert(np.full((number, 4), np.nan))
        assert len(surface_map) == 0
    _assert_same(maps)


def test_a_copy_that_was_begun_before_an_insertion_does_not_see_it():
    _, surface_map = _maps(0.5)
    surface_map.insert(np.zeros((1, 4)))
    copy = surface_map.begin_copy()
    surface_map.insert(np.array([[0.0, 0.0, 0.4, 1.0], [5.0, 0.0, 0.0, 1.0]]))
    copy.step()
    assert copy.blocks.count.tolist() == [1]


def test_a_map_of_many_segments_makes_the_same_rows():
    maps, rng = _maps(0.1), np.random.RandomState(0)
    for _ in range(4):
        points = np.column_stack([rng.uniform(-100.0, 100.0, (4000, 2)), np.zeros((4000, 2))])
        for surface_map in maps:
            surface_map.insert(points)
    _assert_same(maps)
    assert maps[0].nbytes == maps[1].nbytes


@pytest.mark.parametrize("writeable", [True, False])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_no_loop_is_compiled_after_the_map_was_made(dtype, writeable):
    _, surface_map = _maps(0.5)
    loops = [loop for module in MODULES for loop in vars(module).values()]
    loops = [loop for loop in loops if hasattr(loop, "signatures")]
    compiled = [len(loop.signatures) for loop in loops]
    points = np.zeros((3, 4), dtype)
    points.flags.writeable = writeable
    surface_map.insert(points)
    assert len(loops) >= 3
    assert [len(loop.signatures) for loop in loops] == compiled
