"""Points in the order of square cells, in compiled loops. Raises ImportError without numba."""

from collections import namedtuple

import numpy as np
from numba import njit

_MOST_CELLS = 512  # on each side of the grid: bounds its memory, however far apart points lie

Grid = namedtuple("Grid", "low_x low_y rows columns side span")
"""Square cells of `side` [m], row by row from `low_x`, `low_y` on. span: how many cells a reach is at most."""
InCells = namedtuple("InCells", "starts order")
"""order: (m,) points, those of one cell after the other. starts: (cells + 1,) where those of each cell begin."""


@njit(cache=True)
def grid_around(places, reach, cells_per_reach):
    """Return a grid that covers places (n, 2) [m], n > 0, and what lies within `reach` of them."""
    low_x, low_y, high_x, high_y = places[0, 0], places[0, 1], places[0, 0], places[0, 1]
    for point in range(len(places)):
        low_x, high_x = min(low_x, places[point, 0]), max(high_x, places[point, 0])
        low_y, high_y = min(low_y, places[point, 1]), max(high_y, places[point, 1])
    width, height = high_x - low_x + 2.0 * reach, high_y - low_y + 2.0 * reach
    side = max(reach / cells_per_reach, max(width, height) / _MOST_CELLS)
    rows, columns = int(height / side) + 1, int(width / side) + 1
    return Grid(low_x - reach, low_y - reach, rows, columns, side, int(np.ceil(reach / side)))


@njit(cache=True)
def in_cells(places, grid):
    """Return places (n, 2) in the order of their cells; those outside the grid are left out."""
    cell = np.empty(len(places), np.int64)
    starts = np.zeros(grid.rows * grid.columns + 2, np.int64)
    for point in range(len(places)):
        row, column = (places[point, 1] - grid.low_y) / grid.side, (places[point, 0] - grid.low_x) / grid.side
        cell[point] = -1
        if 0.0 <= row < grid.rows and 0.0 <= column < grid.columns:
            cell[point] = int(row) * grid.columns + int(column)
            starts[cell[point] + 2] += 1
    for number in range(grid.rows * grid.columns):
        starts[number + 2] += starts[number + 1]
    order = np.empty(starts[-1], np.int64)
    for point in range(len(places)):
        if cell[point] >= 0:
            order[starts[cell[point] + 1]] = point
            starts[cell[point] + 1] += 1
    return InCells(starts[:-1], order)
