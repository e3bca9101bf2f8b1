"""Compiled loops of insertion: groups of points are merged with the blocks that their cells hold.

An interval is a row as `blocks` describes it. Needs numba.
"""

import numpy as np
from numba import njit

from mlsm_manager.surface_map.blocks import BOTTOM, COUNT, ROW_WIDTH, TOP
from mlsm_manager.surface_map.cell_index import NO_BLOCK
from mlsm_manager.surface_map.compiled_grouping import VALUES


@njit(cache=True)
def _stored_count(heads, following):
    """Return how many rows the cells with first rows `heads` (c,) have."""
    count = 0
    for row in heads:
        while row != NO_BLOCK:
            count += 1
            row = following[row]
    return count


@njit(cache=True)
def merged(groups, group_cell, stored_rows, following, heads, resolution):
    """Return what the cells hold after the groups (g, ROW_WIDTH) went into cells with first rows `heads` (c,).

    Blocks (m, ROW_WIDTH), of which only those that changed are filled in, their row numbers (m,), -1 where new, the
    index of their cell (m,), which of them changed (m,), and the row numbers (f,) of stored ones that are part of
    others now.
    """
    most = len(groups) + _stored_count(heads, following)
    blocks, numbers, owner = np.empty((most, ROW_WIDTH)), np.empty(most, np.int64), np.empty(most, np.int64)
    changed, fused = np.empty(most, np.bool_), np.empty(most, np.int64)
    run, run_rows, stored = np.empty((most, ROW_WIDTH)), np.empty(most, np.int64), np.empty(most, np.int64)
    made, gone, group = 0, 0, 0
    for cell in range(len(heads)):
        held = _stored_by_bottom(heads[cell], following, stored_rows, stored)
        new_top, old_top, length, next_stored = -np.inf, -np.inf, 0, 0
        while True:
            new_bottom = groups[group, BOTTOM] if group < len(groups) and group_cell[group] == cell else np.inf
            old_bottom = stored_rows[stored[next_stored], BOTTOM] if next_stored < held else np.inf
            take_group, bottom = new_bottom <= old_bottom, min(new_bottom, old_bottom)
            is_end = bottom == np.inf
            if length and (is_end or bottom - max(new_top, old_top) >= resolution):
                changed[made] = length > 1 or run_rows[0] < 0
                owner[made] = cell
                if changed[made]:
                    gone = _write_run(run, run_rows, length, blocks[made], numbers, made, fused, gone)
                else:
                    numbers[made] = run_rows[0]
                made += 1
                length = 0
            if is_end:
                break
            if take_group:
                run[length], run_rows[length] = groups[group], -1
                new_top = groups[group, TOP]
                group += 1
            else:
                run[length], run_rows[length] = stored_rows[stored[next_stored]], stored[next_stored]
                old_top = stored_rows[stored[next_stored], TOP]
                next_stored += 1
            length += 1
    return blocks[:made], numbers[:made], owner[:made], changed[:made], fused[:gone]


@njit(cache=True)
def write_blocks(blocks, numbers, owner, changed, slots, stored_rows, following, crossed, heads):
    """Write what `merged` returned into the store, with numbers (m,) for all; `slots` (c,) are the cells' places.

    Points fell into all that changed: no beam crossed it since.
    """
    for block in range(len(blocks)):
        row, cell = numbers[block], owner[block]
        if changed[block]:
            stored_rows[row], crossed[row] = blocks[block], 0
        if block == 0 or owner[block - 1] != cell:
            heads[slots[cell]] = row
        is_last = block + 1 == len(blocks) or owner[block + 1] != cell
        following[row] = NO_BLOCK if is_last else numbers[block + 1]


@njit(cache=True)
def _stored_by_bottom(head, following, stored_rows, stored):
    """Write the row numbers of a cell into `stored`, sorted by bottom, and return how many there are."""
    held, row = 0, head
    while row != NO_BLOCK:
        place = held
        while place > 0 and stored_rows[stored[place - 1], BOTTOM] > stored_rows[row, BOTTOM]:
            stored[place] = stored[place - 1]
            place -= 1
        stored[place] = row
        held += 1
        row = following[row]
    return held


@njit(cache=True)
def _write_run(run, run_rows, length, block, numbers, made, fused, gone):
    """Write the block that `length` intervals make together and its row; return how many rows are free by now."""
    if length == 1:
        block[:], numbers[made] = run[0], run_rows[0]
        return gone
    count, top, kept = 0.0, -np.inf, np.int64(-1)
    for part in range(length):
        count += run[part, COUNT]
        top = max(top, run[part, TOP])
        kept = max(kept, run_rows[part])
    for column in range(VALUES):
        first, total, squares = run[0, column], 0.0, 0.0
        for part in range(length):
            total += (run[part, column] - first) * run[part, COUNT]
        mean = first + total / count
        for part in range(length):
            shift = run[part, column] - mean
            squares += run[part, VALUES + column] + shift * shift * run[part, COUNT]
        block[column], block[VALUES + column] = mean, squares
    block[COUNT], block[BOTTOM], block[TOP] = count, run[0, BOTTOM], top
    numbers[made] = kept
    for part in range(length):
        if run_rows[part] >= 0 and run_rows[part] != kept:
            fused[gone] = run_rows[part]
            gone += 1
    return gone
