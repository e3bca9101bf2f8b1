"""The compiled loops themselves: choosing points, sorting by cell, grouping by height, merging with what is stored.

An interval is a row as `blocks` describes it. Needs numba.
"""

import numpy as np
from numba import njit

from mlsm_manager.surface_map.blocks import BOTTOM, COUNT, ROW_WIDTH, TOP
from mlsm_manager.surface_map.cell_index import NO_BLOCK

_VALUES = 4
"""Mean of x y z and strength, then as many sums of squares: the first columns of a row."""
_FEW = 24
"""Up to so many points insertion sort is the fastest."""
_FIBONACCI = np.uint64(0x9E3779B97F4A7C15)
_FINITE = np.finfo(np.float64).max


@njit(cache=True)
def groups_of(points, resolution, limit):
    """Return what points (n, 4) make by themselves: the keys of their cells (c,), sorted; intervals (g, ROW_WIDTH), and
    indices of their cells (g,); the number of points in them; and of those that are not finite.

    Points beyond `limit` [m] are left out.
    """
    kept, cell, inserted, not_finite = _admitted(points, resolution, limit)
    cells, order, starts = _sorted_by_cell(cell[:inserted], kept)
    groups, owner = _grouped(kept, order, starts, resolution)
    return cells, groups, owner, inserted, not_finite


@njit(cache=True)
def _admitted(points, resolution, limit):
    """Return the points that are finite and within the limit (m, 4), the keys of their cells (m,), their number m, and
    how many are not finite; the arrays are longer than m.
    """
    kept, cell = np.empty((len(points), 4)), np.empty(len(points), np.int64)
    inserted, not_finite = 0, 0
    for point in range(len(points)):
        is_inside, is_finite = True, True
        for column in range(4):
            value = np.float64(points[point, column])
            kept[inserted, column] = value
            is_finite &= abs(value) <= _FINITE
            is_inside &= abs(value) <= limit or column == 3
        not_finite += not is_finite
        if is_finite and is_inside:
            x, y = np.floor(kept[inserted, 0] / resolution), np.floor(kept[inserted, 1] / resolution)
            cell[inserted] = (np.int64(x) << 32) + np.int64(y)
            inserted += 1
    return kept, cell, inserted, not_finite


@njit(cache=True)
def _sorted_by_cell(cell, points):
    """Return the keys (c,) in `cell` (n,), sorted; the order (n,) of the points by cell, height and place in the array;
    and where each cell begins in that order (c + 1,).
    """
    number = len(cell)
    bits = 10
    while (1 << bits) < 2 * number:
        bits += 1
    mask, shift = (1 << bits) - 1, np.uint64(64 - bits)
    table = np.full(1 << bits, -1, dtype=np.int64)
    keys, local, sizes = np.empty(number, np.int64), np.empty(number, np.int64), np.zeros(number + 1, np.int64)
    found = 0
    for point in range(number):
        key = cell[point]
        place = np.int64((np.uint64(key) * _FIBONACCI) >> shift)
        while table[place] >= 0 and keys[table[place]] != key:
            place = (place + 1) & mask
        if table[place] < 0:
            table[place] = found
            keys[found] = key
            found += 1
        local[point] = table[place]
        sizes[table[place]] += 1
    by_key = np.argsort(keys[:found])
    starts = np.zeros(found + 1, np.int64)
    fill = np.empty(found, np.int64)
    for rank in range(found):
        fill[by_key[rank]] = starts[rank]
        starts[rank + 1] = starts[rank] + sizes[by_key[rank]]
    order = np.empty(number, np.int64)
    for point in range(number):
        order[fill[local[point]]] = point
        fill[local[point]] += 1
    for rank in range(found):
        _sort_by_height(order, starts[rank], starts[rank + 1], points)
    return keys[:found][by_key], order, starts


@njit(cache=True)
def _sort_by_height(order, start, end, points):
    """Sort order[start:end] by the height of points (n, 4); equal ones stay in their order."""
    if end - start > _FEW:
        part = order[start:end].copy()
        order[start:end] = part[np.argsort(points[:, 2][part], kind="mergesort")]
        return
    for place in range(start + 1, end):
        point = order[place]
        below = place - 1
        while below >= start and points[order[below], 2] > points[point, 2]:
            order[below + 1] = order[below]
            below -= 1
        order[below + 1] = point


@njit(cache=True)
def _grouped(points, order, starts, resolution):
    """Return the intervals (g, ROW_WIDTH) that points (n, 4) make by themselves, and indices of their cells (g,)."""
    rows, owner = np.empty((len(order), ROW_WIDTH)), np.empty(len(order), np.int64)
    groups = 0
    for cell in range(len(starts) - 1):
        start = starts[cell]
        for place in range(starts[cell] + 1, starts[cell + 1] + 1):
            if place < starts[cell + 1] and points[order[place], 2] - points[order[place - 1], 2] < resolution:
                continue
            _write_group(points, order, start, place, rows[groups])
            owner[groups] = cell
            groups += 1
            start = place
    return rows[:groups], owner[:groups]


@njit(cache=True)
def _write_group(points, order, start, end, row):
    count = np.float64(end - start)
    for column in range(_VALUES):
        first, total, squares = points[order[start], column], 0.0, 0.0
        for place in range(start, end):
            total += points[order[place], column] - first
        mean = first + total / count
        for place in range(start, end):
            deviation = points[order[place], column] - mean
            squares += deviation * deviation
        row[column], row[_VALUES + column] = mean, squares
    row[COUNT] = count
    row[BOTTOM], row[TOP] = points[order[start], 2], points[order[end - 1], 2]


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
                if length > 1:
                    gone = _write_run(run, run_rows, length, blocks[made], numbers, made, fused, gone)
                else:
                    numbers[made] = run_rows[0]
                    if run_rows[0] < 0:
                        blocks[made] = run[0]
                owner[made] = cell
                changed[made] = length > 1 or run_rows[0] < 0
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
    count, top, kept = 0.0, -np.inf, np.int64(-1)
    for part in range(length):
        count += run[part, COUNT]
        top = max(top, run[part, TOP])
        kept = max(kept, run_rows[part])
    for column in range(_VALUES):
        first, total, squares = run[0, column], 0.0, 0.0
        for part in range(length):
            total += (run[part, column] - first) * run[part, COUNT]
        mean = first + total / count
        for part in range(length):
            shift = run[part, column] - mean
            squares += run[part, _VALUES + column] + shift * shift * run[part, COUNT]
        block[column], block[_VALUES + column] = mean, squares
    block[COUNT], block[BOTTOM], block[TOP] = count, run[0, BOTTOM], top
    numbers[made] = kept
    for part in range(length):
        if run_rows[part] >= 0 and run_rows[part] != kept:
            fused[gone] = run_rows[part]
            gone += 1
    return gone
