"""Intervals of height out of points: these are chosen, sorted by cell and height, and split at gaps.

A point belongs to a block when it is closer than the resolution to its top or bottom, or between them, and a point that
belongs to several fuses them (thesis 6.5.6). In one cell that is single linkage in z: the partition that is left at
the end does not depend on the order in which the points came. So a whole scan is sorted once and split at its gaps.
"""

from typing import NamedTuple, Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import BOTTOM, COUNT, ROW_WIDTH, TOP, keys_of
from node_support.numba_cache import compiled

VALUES = 4  # mean of x y z and strength, then as many sums of squares: the first columns of a row
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


def grouped_points(points: np.ndarray, resolution: float) -> Tuple[np.ndarray, Groups]:
    """Return the keys (c,) of the cells of points (n, 4), sorted, and the Groups that the points make by themselves."""
    cells, order, starts = sorted_by_cell(keys_of(points, resolution), points[:, 2])
    return cells, Groups(*_split_at_gaps(points, order, starts, resolution))


def sorted_by_cell(cell: np.ndarray, height: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the keys (c,) in `cell` (n,), sorted; the order (n,) that sorts by cell, height (n,) and place in the
    array; and where each cell begins in that order (c + 1,).
    """
    order = np.lexsort((height, cell))
    keys = cell[order]
    starts = np.flatnonzero(np.diff(keys, prepend=keys[:1] - 1))
    return keys[starts], order, np.append(starts, len(keys))


@compiled()
def _split_at_gaps(points, order, starts, resolution):
    """Return the members of the Groups of points (n, 4) that are sorted by cell; order, starts: see sorted_by_cell."""
    rows, owner = np.empty((len(points), ROW_WIDTH)), np.empty(len(points), np.int64)
    groups = 0
    for number in range(len(starts) - 1):
        start = starts[number]
        for place in range(starts[number] + 1, starts[number + 1] + 1):
            if place < starts[number + 1] and points[order[place], 2] - points[order[place - 1], 2] < resolution:
                continue
            _write_group(points, order, start, place, rows[groups])
            owner[groups] = number
            groups += 1
            start = place
    return rows[:groups], owner[:groups], np.zeros(groups, np.uint16)


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
