"""The compiled loops that make intervals of height out of points: chosen, sorted by cell and height, split at gaps.

A point belongs to a block when it is closer than the resolution to its top or bottom, or between them, and a point that
belongs to several fuses them (thesis 6.5.6). In one cell that is single linkage in z: the partition that is left at
the end does not depend on the order in which the points came. So a whole scan is sorted once and split at its gaps.
"""

from typing import NamedTuple

import numpy as np

from mlsm_manager.surface_map.blocks import BOTTOM, COUNT, ROW_WIDTH, TOP
from node_support.numba_cache import compiled

VALUES = 4  # mean of x y z and strength, then as many sums of squares: the first columns of a row
_FEW = 24  # up to so many points insertion sort is the fastest
_FIBONACCI = np.uint64(0x9E3779B97F4A7C15)
_FINITE = np.finfo(np.float64).max


class Groups(NamedTuple):
    """Intervals of height in cells, sorted by cell, then by bottom.

    rows: (g, ROW_WIDTH) as Blocks has them. cell: (g,) int64 index of the cell. crossed: (g,) uint16 number of beams
    that crossed it since a point last fell into it.
    """

    rows: np.ndarray
    cell: np.ndarray
    crossed: np.ndarray


@compiled()
def finite_within(points, limit):
    """Return those of points (n, 4) that are finite and have no coordinate beyond `limit` [m], (m, 4) float64, and how
    many are not finite.
    """
    kept, number, not_finite = np.empty((len(points), 4)), 0, 0
    for point in range(len(points)):
        is_inside, is_finite = True, True
        for column in range(4):
            value = np.float64(points[point, column])
            kept[number, column] = value
            is_finite &= abs(value) <= _FINITE
            is_inside &= abs(value) <= limit or column == 3
        not_finite += not is_finite
        number += is_finite and is_inside
    return kept[:number], not_finite


@compiled()
def grouped_points(points, resolution):
    """Return the keys (c,) of the cells of points (n, 4), sorted, and the Groups that the points make by themselves."""
    cell = np.empty(len(points), np.int64)
    for point in range(len(points)):
        x, y = np.floor(points[point, 0] / resolution), np.floor(points[point, 1] / resolution)
        cell[point] = (np.int64(x) << 32) + np.int64(y)
    cells, order, starts = sorted_by_cell(cell, points[:, 2])
    rows, owner = np.empty((len(points), ROW_WIDTH)), np.empty(len(points), np.int64)
    groups = 0
    for number in range(len(cells)):
        start = starts[number]
        for place in range(starts[number] + 1, starts[number + 1] + 1):
            if place < starts[number + 1] and points[order[place], 2] - points[order[place - 1], 2] < resolution:
                continue
            _write_group(points, order, start, place, rows[groups])
            owner[groups] = number
            groups += 1
            start = place
    return cells, Groups(rows[:groups], owner[:groups], np.zeros(groups, np.uint16))


@compiled()
def sorted_by_cell(cell, height):
    """Return the keys (c,) in `cell` (n,), sorted; the order (n,) that sorts by cell, height (n,) and place in the
    array; and where each cell begins in that order (c + 1,).
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
        _sort_by_height(order, starts[rank], starts[rank + 1], height)
    return keys[by_key], order, starts


@compiled()
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


@compiled()
def _sort_by_height(order, start, end, height):
    """Sort order[start:end] by height (n,); equal ones stay in their order."""
    if end - start > _FEW:
        part = order[start:end].copy()
        order[start:end] = part[np.argsort(height[part], kind="mergesort")]
        return
    for place in range(start + 1, end):
        point = order[place]
        below = place - 1
        while below >= start and height[order[below]] > height[point]:
            order[below + 1] = order[below]
            below -= 1
        order[below + 1] = point


@compiled()
def _write_group(points, order, start, end, row):
    count = np.float64(end - start)
    for column in range(VALUES):
        # From one of the points on: a plain sum rounds, and the mean of points on a border would leave their cell.
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
