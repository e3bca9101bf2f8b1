"""Compiled loops of insertion: points are chosen, sorted by cell and height, and grouped into intervals.

An interval is a row as `blocks` describes it. Needs numba.
"""

import numpy as np
from numba import njit

from mlsm_manager.surface_map.blocks import BOTTOM, COUNT, ROW_WIDTH, TOP

VALUES = 4
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
    keys, owner, sizes = _told_apart(cell)
    by_key = np.argsort(keys)
    starts, fill = np.zeros(len(keys) + 1, np.int64), np.empty(len(keys), np.int64)
    for rank in range(len(keys)):
        fill[by_key[rank]] = starts[rank]
        starts[rank + 1] = starts[rank] + sizes[by_key[rank]]
    order = np.empty(len(cell), np.int64)
    for point in range(len(cell)):
        order[fill[owner[point]]] = point
        fill[owner[point]] += 1
    for rank in range(len(keys)):
        _sort_by_height(order, starts[rank], starts[rank + 1], points)
    return keys[by_key], order, starts


@njit(cache=True)
def _told_apart(cell):
    """Return the different keys (c,) in `cell` (n,) as they come, the index of each point's (n,), and how many points
    each has (c,): by hashing, into a table at most half full.
    """
    number = len(cell)
    bits = 10
    while (1 << bits) < 2 * number:
        bits += 1
    mask, shift = (1 << bits) - 1, np.uint64(64 - bits)
    table = np.full(1 << bits, -1, dtype=np.int64)
    keys, owner, sizes = np.empty(number, np.int64), np.empty(number, np.int64), np.zeros(number, np.int64)
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
        owner[point] = table[place]
        sizes[table[place]] += 1
    return keys[:found], owner, sizes[:found]


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
    for column in range(VALUES):
        first, total, squares = points[order[start], column], 0.0, 0.0
        for place in range(start, end):
            total += points[order[place], column] - first
        mean = first + total / count
        for place in range(start, end):
            deviation = points[order[place], column] - mean
            squares += deviation * deviation
        row[column], row[VALUES + column] = mean, squares
    row[COUNT] = count
    row[BOTTOM], row[TOP] = points[order[start], 2], points[order[end - 1], 2]
