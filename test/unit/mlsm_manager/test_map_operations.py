"""Maps moved, merged, cropped and compared."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from made_maps import in_order, partition, random_points

from mlsm_manager.surface_map.map_file import Layer, StoredMap
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from mlsm_manager.surface_map.operations import LevelTransform, cropped, difference, merged, merged_blocks

RESOLUTION = 0.5
seeds = st.integers(0, 2**31)


def _blocks(points):
    surface_map = MultiLevelSurfaceMap(RESOLUTION)
    surface_map.insert(points)
    return surface_map.blocks


def _points_moved(points, T_new_old):
    result = points.copy()
    result[:, :2] = points[:, :2] @ T_new_old.rotation().T + (T_new_old.x, T_new_old.y)
    result[:, 2] += T_new_old.z
    return result


def _total(blocks):
    """Return number, mean and variance of all points of all blocks."""
    count = blocks.count.sum()
    mean = (blocks.mean * blocks.count[:, np.newaxis]).sum(axis=0) / count
    squares = (blocks.variance + (blocks.mean - mean) ** 2) * blocks.count[:, np.newaxis]
    return count, mean, squares.sum(axis=0) / count


@given(seeds, st.integers(-9, 9), st.integers(-9, 9), st.sampled_from([-2.0, 0.0, 0.25, 3.5]), st.integers(-3, 4))
@settings(max_examples=50)
def test_where_cells_align_merging_makes_the_map_of_all_points(seed, x, y, z, quarters):
    transform = LevelTransform(x * RESOLUTION, y * RESOLUTION, z, quarters * np.pi / 2.0)
    assert transform.keeps_cells(RESOLUTION)
    first, second = random_points(seed, 300, 2.0), random_points(seed + 1, 300, 2.0)
    # A 2 ** -20 m grid: moving it rounds nothing, so that no point changes its cell by rounding.
    first, second = (np.rint(points * 2**20) / 2**20 + 2.0**-22 for points in (first, second))
    expected = _blocks(np.concatenate([first, _points_moved(second, transform)]))
    blocks = merged_blocks(_blocks(first), _blocks(second), transform)
    assert partition(blocks) == partition(expected)
    blocks, expected = blocks.take(in_order(blocks)), expected.take(in_order(expected))
    np.testing.assert_allclose(blocks.mean, expected.mean, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(blocks.variance, expected.variance, rtol=1e-9, atol=1e-12)


@given(seeds, st.floats(-9, 9), st.floats(-9, 9), st.floats(-9, 9), st.floats(-np.pi, np.pi))
@settings(max_examples=50)
def test_where_cells_do_not_align_the_points_as_a_whole_keep_number_mean_height_and_strength(seed, x, y, z, yaw):
    transform = LevelTransform(x, y, z, yaw)
    first, second = random_points(seed, 200, 4.0), random_points(seed + 1, 200, 4.0)
    points = np.concatenate([first, _points_moved(second, transform)])
    blocks = merged_blocks(_blocks(first), _blocks(second), transform)
    count, mean, variance = _total(blocks)
    assert count == 400
    np.testing.assert_allclose(mean, points.mean(axis=0), rtol=1e-9, atol=1e-9)
    expected = points.var(axis=0)
    np.testing.assert_allclose(variance[2:], expected[2:], rtol=1e-9)
    np.testing.assert_allclose(variance[:2].sum(), expected[:2].sum(), rtol=1e-9)
    assert (blocks.bottom.min(), blocks.height.max()) == (points[:, 2].min(), points[:, 2].max())


def test_merged_maps_have_the_layers_of_both():
    shown, other = _blocks(random_points(0, 50)), _blocks(random_points(1, 50))
    first = StoredMap("map", {Layer.SHOWN: shown}, {"range_scale": 0.9})
    second = StoredMap("other", {Layer.SHOWN: other, Layer.FREE: other})
    both = merged(first, second, LevelTransform(x=100.0))
    assert (both.frame, both.calibration) == ("map", {"range_scale": 0.9})
    assert len(both.shown) == len(shown) + len(other)
    assert both.layers[Layer.FREE].mean[:, 0].min() > 80.0


def test_a_cropped_map_holds_what_lies_in_the_box():
    blocks = _blocks(random_points(0, 500))
    stored = cropped(StoredMap("map", {Layer.SHOWN: blocks}), np.array([0.0, -5.0]), np.array([5.0, 5.0]))
    assert 0 < len(stored.shown) < len(blocks)
    assert (stored.shown.mean[:, 0] >= 0.0).all()


def test_a_map_does_not_differ_from_itself():
    blocks = _blocks(random_points(0, 500))
    result = difference(blocks, blocks)
    assert (len(result.only_first), len(result.only_second), len(result.both)) == (0, 0, len(blocks))
    assert result.shift.tolist() == [0.0] * len(blocks)


def test_a_difference_is_told_by_place_and_height():
    first = _blocks(np.array([[0.1, 0.1, 0.0, 1.0], [5.1, 0.1, 0.0, 1.0], [9.1, 0.1, 0.0, 1.0]]))
    second = _blocks(np.array([[0.1, 0.1, 0.3, 1.0], [5.1, 0.1, 2.0, 1.0], [9.1, 4.1, 0.0, 1.0]]))
    result = difference(first, second)
    assert sorted(result.only_first.mean[:, 0]) == [5.1, 9.1]
    assert sorted(result.only_second.mean[:, 1]) == [0.1, 4.1]
    assert result.both.mean[:, 0].tolist() == [0.1]
    assert result.shift.tolist() == [0.3]


def test_all_of_a_map_is_new_to_an_empty_one():
    blocks = _blocks(random_points(0, 50))
    result = difference(MultiLevelSurfaceMap(RESOLUTION).blocks, blocks)
    assert (len(result.only_first), len(result.only_second)) == (0, len(blocks))
