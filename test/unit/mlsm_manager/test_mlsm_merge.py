"""Blocks inserted into a map: the map that all points together make; and the blocks that lie in a box."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_maps import in_order, partition, random_map, random_points

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap


def _assert_same_map(blocks, expected):
    assert partition(blocks) == partition(expected)
    blocks, expected = blocks.take(in_order(blocks)), expected.take(in_order(expected))
    np.testing.assert_allclose(blocks.mean, expected.mean, rtol=1e-12, atol=1e-10)
    np.testing.assert_allclose(blocks.variance, expected.variance, rtol=1e-7, atol=1e-9)


@given(st.integers(0, 2**31), st.integers(1, 300), st.integers(1, 300), st.floats(0.3, 5.0))
@settings(max_examples=60)
def test_inserted_blocks_make_the_map_that_all_points_make(seed, first, second, extent):
    points, others = random_points(seed, first, extent), random_points(seed + 1, second, extent)
    one, merged, other = MultiLevelSurfaceMap(0.5), MultiLevelSurfaceMap(0.5), MultiLevelSurfaceMap(0.5)
    one.insert(np.concatenate([points, others]))
    merged.insert(points)
    other.insert(others)
    merged.insert_blocks(other.blocks)
    _assert_same_map(merged.blocks, one.blocks)


def test_blocks_that_overlap_among_themselves_become_one():
    column = np.array([[0.1, 0.1, z, 1.0] for z in (0.0, 0.4, 0.8, 1.2)])
    surface_map = MultiLevelSurfaceMap(0.5)
    surface_map.insert(column)
    tall = surface_map.blocks
    inner = MultiLevelSurfaceMap(0.5)
    inner.insert(np.array([[0.1, 0.1, 0.1, 1.0], [0.1, 0.1, 1.0, 1.0]]))
    merged = MultiLevelSurfaceMap(0.5)
    merged.insert_blocks(Blocks(np.concatenate([tall.rows, inner.blocks.rows]), 0.5))
    assert partition(merged.blocks) == [((0, 0), 0.0, 1.2, 6, 1)]


def test_inserted_blocks_keep_their_crossings_and_end_those_of_what_they_meet():
    surface_map, other = MultiLevelSurfaceMap(0.5), MultiLevelSurfaceMap(0.5)
    for one, place, crossings in ((surface_map, 0.1, 9), (other, 0.1, 3), (other, 5.1, 4)):
        one.insert(np.array([[place, 0.1, 0.0, 1.0]]))
        _, rows, _ = one.find(np.array([[int(place / 0.5), 0]]))
        one.count_crossings(rows, np.array([crossings]))
    surface_map.insert_blocks(other.blocks)
    assert surface_map.blocks.crossed.tolist() == [3, 4]


def test_blocks_of_another_resolution_are_refused():
    with pytest.raises(ValueError, match=r"resolution 0\.25 m: must be the map's, 0\.5 m"):
        MultiLevelSurfaceMap(0.5).insert_blocks(random_map(resolution=0.25).blocks)


def test_blocks_beyond_the_limit_are_counted_by_their_points():
    surface_map = MultiLevelSurfaceMap(0.5, limit=5.0)
    blocks = random_map(count=500).blocks
    report = surface_map.insert_blocks(blocks)
    assert report.outside > 0
    assert report.inserted + report.outside == 500
    assert int(surface_map.blocks.count.sum()) == report.inserted


@given(st.integers(0, 2**31), st.lists(st.floats(-12, 12), min_size=4, max_size=4))
@settings(max_examples=60)
def test_a_box_holds_the_blocks_that_a_look_at_all_finds_in_the_same_order(seed, corners):
    low, high = np.minimum(corners[:2], corners[2:]), np.maximum(corners[:2], corners[2:])
    surface_map = random_map(seed, count=1500)
    assert surface_map.in_box(low, high).rows.tolist() == surface_map.blocks.in_box(low, high).rows.tolist()


def test_a_box_may_be_bounded_in_height():
    surface_map = random_map()
    low, high = np.array([-5.0, -5.0, -1.0]), np.array([5.0, 5.0, 1.0])
    found = surface_map.in_box(low, high)
    assert 0 < len(found) < len(surface_map.in_box(low[:2], high[:2]))
    assert ((found.mean[:, 2] >= -1.0) & (found.mean[:, 2] <= 1.0)).all()


def test_a_box_without_cells_holds_no_blocks():
    assert len(random_map().in_box(np.array([50.0, 50.0]), np.array([60.0, 60.0]))) == 0


def test_only_tiles_that_changed_are_told_and_only_once():
    surface_map = MultiLevelSurfaceMap(0.5)
    surface_map.insert(np.array([[0.1, 0.1, 0, 1], [-0.1, 20.0, 0, 1]]))
    assert surface_map.take_changed_tiles().tolist() == [[-1, 2], [0, 0]]
    assert surface_map.take_changed_tiles().tolist() == []
    surface_map.insert(np.array([[0.1, 0.1, 9, 1]]))
    assert surface_map.take_changed_tiles().tolist() == [[0, 0]]


def test_the_tiles_together_hold_the_map():
    surface_map = random_map(extent=40.0)
    tiles = surface_map.take_changed_tiles()
    assert len(tiles) > 4
    rows = np.concatenate([surface_map.in_tiles(part).rows for part in np.array_split(tiles, 3)])
    assert sorted(rows.tolist()) == sorted(surface_map.blocks.rows.tolist())


def test_tiles_that_nobody_asks_for_do_not_pile_up():
    surface_map = MultiLevelSurfaceMap(0.5)
    for place in range(200):
        surface_map.insert(np.array([[place % 7 * 8.0, 0.0, 0.0, 1.0]]))
    assert len(surface_map.take_changed_tiles()) == 7
