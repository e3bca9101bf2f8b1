"""The compiled search for the nearest points of each block of scans, over square cells.

It is compiled, or read from the cache on disk, when this module is imported: never while a scan waits. Raises
ImportError without numba.
"""

from collections import namedtuple

import numpy as np
from numba import njit

CANDIDATES = 6
"""Nearest points of a block that may share a comparison."""
_CELLS_PER_REACH = 2  # small cells fill a circle better, many cells take time
_MOST_CELLS = 512  # on each side of the grid of cells: bounds its memory, however far apart points lie
_SLACK = 1.0 + 1e-9  # of a squared distance: so far may it be rounded
_FIRST_CAPACITY = 1024

_Grid = namedtuple("_Grid", "low_x low_y rows columns side starts")
"""Square cells of `side` [m]. starts: (rows * columns + 1,) where the points of each cell begin."""
_Targets = namedtuple("_Targets", "x y scan block row")
"""Points in the order of their cells; row: (k,) where each stood before."""
_Nearest = namedtuple("_Nearest", "distance row held limit touched")
"""What one source has found: of each block the nearest points (b, CANDIDATES), how many are held (b,), and the squared
distance (b,) from which on no more are needed; and the blocks with any (b,)."""


@njit(cache=True)
def _kept(distances, rows, held, distance, row):
    """Put a point among the nearest ones of a block, of which `held` are known; return how many are known then."""
    place = held
    if held == CANDIDATES:
        if distance >= distances[CANDIDATES - 1]:
            return held
        place = CANDIDATES - 1
    while place > 0 and distances[place - 1] > distance:
        distances[place], rows[place] = distances[place - 1], rows[place - 1]
        place -= 1
    distances[place], rows[place] = distance, row
    return min(held + 1, CANDIDATES)


@njit(cache=True)
def _doubled(array):
    """Return an array that begins with `array` and is twice as long."""
    longer = np.empty(2 * len(array), array.dtype)
    longer[: len(array)] = array
    return longer


@njit(cache=True)
def _write_shares(distances, rows, held, tie, neighbours, found, shares):
    """Share a comparison among the candidates that are hardly farther than the nearest; return how many are written."""
    made = 0
    total = 0.0
    for place in range(held):
        total += max(1.0 - (distances[place] - distances[0]) / tie, 0.0)
    for place in range(held):
        share = max(1.0 - (distances[place] - distances[0]) / tie, 0.0) / total
        if share > 0.0:
            neighbours[made], found[made], shares[made] = rows[place], distances[place], share
            made += 1
    return made


@njit(cache=True)
def _grid_of(places, reach):
    """Return the grid of places (n, 2), n > 0, and their order (n,) by its cells."""
    low_x, low_y, high_x, high_y = places[0, 0], places[0, 1], places[0, 0], places[0, 1]
    for point in range(len(places)):
        low_x, high_x = min(low_x, places[point, 0]), max(high_x, places[point, 0])
        low_y, high_y = min(low_y, places[point, 1]), max(high_y, places[point, 1])
    side = max(reach / _CELLS_PER_REACH, max(high_x - low_x, high_y - low_y) / _MOST_CELLS)
    columns, rows = int((high_x - low_x) / side) + 1, int((high_y - low_y) / side) + 1
    cell = np.empty(len(places), np.int64)
    starts = np.zeros(rows * columns + 1, np.int64)
    for point in range(len(places)):
        cell[point] = int((places[point, 1] - low_y) / side) * columns + int((places[point, 0] - low_x) / side)
        starts[cell[point] + 1] += 1
    for number in range(rows * columns):
        starts[number + 1] += starts[number]
    fill, order = starts[:-1].copy(), np.empty(len(places), np.int64)
    for point in range(len(places)):
        order[fill[cell[point]]] = point
        fill[cell[point]] += 1
    return _Grid(low_x, low_y, rows, columns, side, starts), order


@njit(cache=True)
def _outwards(middle, step):
    """Return the numbers middle, middle + 1, middle - 1, middle + 2, ... for steps 0, 1, 2, 3, ..."""
    return middle + (step + 1) // 2 if step % 2 else middle - step // 2


@njit(cache=True)
def _look_around(x, y, scan, reach, tie, grid, targets, nearest):
    """Find the nearest points of each block around x, y; return how many blocks have any.

    Near cells come first: what is far then needs one comparison only.
    """
    span, touched = int(np.ceil(reach / grid.side)), 0
    own_row, own_column = int(np.floor((y - grid.low_y) / grid.side)), int(np.floor((x - grid.low_x) / grid.side))
    for row_step in range(2 * span + 1):
        row = _outwards(own_row, row_step)
        if row < 0 or row >= grid.rows:
            continue
        for column_step in range(2 * span + 1):
            column = _outwards(own_column, column_step)
            if column < 0 or column >= grid.columns:
                continue
            cell = row * grid.columns + column
            for place in range(grid.starts[cell], grid.starts[cell + 1]):
                across, along = targets.x[place] - x, targets.y[place] - y
                square, block = across * across + along * along, targets.block[place]
                if square >= nearest.limit[block] or targets.scan[place] == scan:
                    continue
                if nearest.held[block] == 0:
                    nearest.touched[touched] = block
                    touched += 1
                distances = nearest.distance[block]
                nearest.held[block] = _kept(
                    distances, nearest.row[block], nearest.held[block], np.sqrt(square), targets.row[place]
                )
                nearest.limit[block] = min(nearest.limit[block], _SLACK * (distances[0] + tie) ** 2)
    return touched


@njit(
    "Tuple((i8[::1], i8[::1], f8[::1], f8[::1]))(f8[:,::1], i8[::1], f8[:,::1], i8[::1], i8[::1], i8, f8, f8)",
    cache=True,
)
def shared_neighbours(sources, source_scans, places, scans, blocks, count, cut, tie):
    """Return rows of sources, rows of their neighbours, distances and shares, each (m,); see association.Neighbours.

    sources: (n, 2) m. places: (k, 2) m, scans: (k,), blocks: (k,) from 0 to before `count`: of the targets, k > 0.
    """
    reach = cut + tie
    grid, order = _grid_of(places, reach)
    targets = _Targets(places[order, 0], places[order, 1], scans[order], blocks[order], order)
    nearest = _Nearest(
        np.empty((count, CANDIDATES)), np.empty((count, CANDIDATES), np.int64), np.zeros(count, np.int64),
        np.full(count, reach * reach), np.empty(count, np.int64),
    )  # fmt: skip
    rows, neighbours = np.empty(_FIRST_CAPACITY, np.int64), np.empty(_FIRST_CAPACITY, np.int64)
    distances, shares = np.empty(_FIRST_CAPACITY), np.empty(_FIRST_CAPACITY)
    made = 0
    for source in range(len(sources)):
        x, y = sources[source, 0], sources[source, 1]
        if not (grid.low_x - reach < x < grid.low_x + grid.columns * grid.side + reach):
            continue
        if not (grid.low_y - reach < y < grid.low_y + grid.rows * grid.side + reach):
            continue
        for number in range(_look_around(x, y, source_scans[source], reach, tie, grid, targets, nearest)):
            block = nearest.touched[number]
            if nearest.distance[block, 0] < cut:
                if made + CANDIDATES > len(rows):
                    rows, neighbours = _doubled(rows), _doubled(neighbours)
                    distances, shares = _doubled(distances), _doubled(shares)
                end = made + _write_shares(
                    nearest.distance[block], nearest.row[block], nearest.held[block], tie,
                    neighbours[made:], distances[made:], shares[made:],
                )  # fmt: skip
                rows[made:end] = source
                made = end
            nearest.held[block], nearest.limit[block] = 0, reach * reach
    return rows[:made].copy(), neighbours[:made].copy(), distances[:made].copy(), shares[:made].copy()
