"""Boxes show blocks where they are and as high as they are."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_blocks import blocks_of, boxes_by_list

from mlsm_manager.surface_map.tiles import THINNEST, TILE_BITS, box_lists

BOTTOMS = st.floats(-50.0, 50.0)
DEPTHS = st.one_of(st.floats(0.0, 40.0), st.integers(0, 64).map(lambda eighths: eighths * 0.125))


def _drawn(lists):
    """Return {x y of the cell's centre: [(bottom, top) of its boxes, from below]}."""
    drawn = {}
    for boxes in lists:
        for x, y, z in boxes.centers:
            drawn.setdefault((x, y), []).append((z - boxes.size[2] / 2.0, z + boxes.size[2] / 2.0))
    return {cell: sorted(spans) for cell, spans in drawn.items()}


@given(st.lists(st.tuples(BOTTOMS, DEPTHS), min_size=1, max_size=20), st.sampled_from([0.1, 0.5, 1.0]))
def test_boxes_reach_from_bottom_to_top_without_a_gap(intervals, resolution):
    blocks = blocks_of([(bottom, bottom + depth) for bottom, depth in intervals], resolution)
    drawn = _drawn(boxes_by_list(blocks))
    assert len(drawn) == len(blocks)
    for center, bottom, top in zip(blocks.centers, blocks.bottom, blocks.height):
        spans = drawn[tuple(center)]
        thickness = max(top - bottom, resolution * 2.0**THINNEST)
        middle = (bottom + top) / 2.0
        assert spans[0][0] == pytest.approx(middle - thickness / 2.0, abs=1e-9)
        assert spans[-1][1] == pytest.approx(middle + thickness / 2.0, abs=1e-9)
        assert all(upper[0] <= lower[1] + 1e-9 for lower, upper in zip(spans, spans[1:]))


@given(st.lists(st.tuples(BOTTOMS, DEPTHS), min_size=1, max_size=20))
def test_every_list_holds_blocks_of_one_kind(intervals):
    blocks = blocks_of([(bottom, bottom + depth) for bottom, depth in intervals], 0.5)
    kinds = dict(zip(map(tuple, blocks.centers), blocks.type))
    for boxes in boxes_by_list(blocks):
        assert {kinds[x, y] for x, y, _ in boxes.centers} == {boxes.type}


def test_a_flat_block_is_drawn_a_sixteenth_of_a_cell_thick_around_its_height():
    (boxes,) = boxes_by_list(blocks_of([(-3.0, -3.0)]))
    assert boxes.size.tolist() == [0.5, 0.5, 0.03125]
    np.testing.assert_allclose(boxes.centers, [[0.25, 0.25, -3.0]])


@pytest.mark.parametrize(("interval", "heights"), [((1.0, 3.0), [2.0]), ((0.0, 3.0), [1.0, 2.0])])
def test_a_depth_that_is_a_power_of_two_takes_one_box_and_any_other_two_that_overlap(interval, heights):
    (boxes,) = boxes_by_list(blocks_of([interval]))
    assert sorted(boxes.centers[:, 2].tolist()) == heights
    assert boxes.size.tolist() == [0.5, 0.5, 2.0]


def test_a_tile_of_metres_needs_few_lists_and_none_twice():
    lists = boxes_by_list(blocks_of([(0.0, depth) for depth in np.linspace(0.0, 60.0, 2000)]))
    powers = {}
    for boxes in lists:
        powers.setdefault(boxes.tile, []).append(boxes.power)
    assert all(len(told) == len(set(told)) <= 11 for told in powers.values())


def test_a_box_lies_in_its_tile_and_knows_its_block():
    blocks = blocks_of([(0.0, 3.0)] * 50)
    for boxes in boxes_by_list(blocks):
        np.testing.assert_array_equal(boxes.centers[:, :2], blocks.centers[boxes.owners])
        assert {tuple(tile) for tile in (blocks.cells[boxes.owners] >> TILE_BITS).tolist()} == {boxes.tile}


def test_no_blocks_make_no_boxes():
    boxes = box_lists(blocks_of([]))
    assert (len(boxes.tiles), len(boxes.powers), boxes.starts.tolist(), len(boxes.centers)) == (0, 0, [0], 0)
