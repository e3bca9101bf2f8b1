"""Points in the order of square cells, in compiled loops.

They are compiled, or read from the cache on disk, when this module is imported: never while a scan waits. Python calls
them, no compiled loop of another file does: numba's cache would not notice a change. Raises ImportError without numba.
"""

from typing import NamedTuple

import numpy as np

from node_support.numba_cache import compiled

_CELLS_PER_REACH = 2  # small cells leave less to compare for each source, but more to gather
_MOST_CELLS = 512  # on each side of the grid: bounds its memory, however far apart points lie


class Cells(NamedTuple):
    """Square cells of `side` [m], row by row from `low_x`, `low_y` on. span: how many cells a reach is at most.

    target_order: (k,) the targets, those of one cell after the other. target_starts: (cells + 1,) where those of each
    cell begin. source_order, source_starts: the same of the sources; those farther than the reach are left out.
    """

    low_x: float
    low_y: float
    rows: int
    columns: int
    side: float
    span: int
    target_starts: np.ndarray
    target_order: np.ndarray
    source_starts: np.ndarray
    source_order: np.ndarray


@compiled()
def _sorted(places, low_x, low_y, rows, columns, side):
    """Return where the points of each cell begin, and the points in this order; those in no cell are left out."""
    cell = np.empty(len(places), np.int64)
    starts = np.zeros(rows * columns + 2, np.int64)
    for point in range(len(places)):
        row, column = (places[point, 1] - low_y) / side, (places[point, 0] - low_x) / side
        cell[point] = -1
        if 0.0 <= row < rows and 0.0 <= column < columns:
            cell[point] = int(row) * columns + int(column)
            starts[cell[point] + 2] += 1
    for number in range(rows * columns):
        starts[number + 2] += starts[number + 1]
    order = np.empty(starts[-1], np.int64)
    for point in range(len(places)):
        if cell[point] >= 0:
            order[starts[cell[point] + 1]] = point
            starts[cell[point] + 1] += 1
    return starts[:-1].copy(), order


@compiled(
    "Tuple((f8, f8, i8, i8, f8, i8, i8[::1], i8[::1], i8[::1], i8[::1]))(f8[:,::1], f8[:,::1], f8)",
    error_model="numpy",
)
def sorted_into_cells(sources, targets, reach):
    """Return the fields of Cells that cover targets (k, 2) [m], k > 0, and what lies within `reach` of them.

    sources: (n, 2) m.
    """
    low_x, low_y, high_x, high_y = targets[0, 0], targets[0, 1], targets[0, 0], targets[0, 1]
    for point in range(len(targets)):
        low_x, high_x = min(low_x, targets[point, 0]), max(high_x, targets[point, 0])
        low_y, high_y = min(low_y, targets[point, 1]), max(high_y, targets[point, 1])
    low_x, low_y, width, height = low_x - reach, low_y - reach, high_x - low_x + 2 * reach, high_y - low_y + 2 * reach
    side = max(reach / _CELLS_PER_REACH, max(width, height) / _MOST_CELLS)
    rows, columns = int(height / side) + 1, int(width / side) + 1
    target_starts, target_order = _sorted(targets, low_x, low_y, rows, columns, side)
    source_starts, source_order = _sorted(sources, low_x, low_y, rows, columns, side)
    span = int(np.ceil(reach / side))
    return low_x, low_y, rows, columns, side, span, target_starts, target_order, source_starts, source_order
