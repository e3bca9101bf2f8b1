"""Insertion of points and of blocks into a store: compiled loops merge them with the blocks that their cells hold.

A point belongs to a block when it is closer than the resolution to its top or bottom, or between them, and a point that
belongs to several fuses them (thesis 6.5.6). In one cell that is single linkage in z: the partition that is left at
the end does not depend on the order in which the points came. So a whole scan is sorted once and split at its gaps.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Tuple

import numpy as np

from mlsm_manager.surface_map.block_store import NO_BLOCK, BlockStore, Runs
from mlsm_manager.surface_map.blocks import BOTTOM, COUNT, ROW_WIDTH, TOP, Blocks
from node_support.geometry import keys_of
from node_support.numba_cache import compiled

_VALUES = 4  # mean of x y z and strength, then as many sums of squares: the first columns of a row
_FINITE = np.finfo(np.float64).max


_Groups = Tuple[np.ndarray, np.ndarray, np.ndarray]
"""Intervals of height in cells, sorted by cell, then by bottom: rows (g, ROW_WIDTH) as Blocks has them, index of the
cell (g,) int64, and crossings (g,) uint16."""


@dataclass(frozen=True)
class InsertReport:
    """Points of one insertion: `inserted`, and `outside` the limit."""

    inserted: int
    outside: int


def admitted(points: np.ndarray, limit: float) -> Tuple[np.ndarray, InsertReport]:
    """Return which points (n, 4) are finite and have no coordinate beyond `limit` [m], and what became of all."""
    kept, not_finite = _finite_within(np.ascontiguousarray(points, dtype=np.float64), limit)
    return kept, InsertReport(len(kept), len(points) - len(kept) - not_finite)


def blocks_of(points: np.ndarray, resolution: float, limit: float = np.inf) -> Blocks:
    """Return the blocks that points (n, 4) make in an empty map; `limit`: see `admitted`."""
    _, (rows, _, crossed) = _grouped_points(admitted(points, limit)[0], resolution)
    return Blocks(rows, resolution, crossed)


def insert_points(store: BlockStore, points: np.ndarray) -> np.ndarray:
    """Insert admitted points (n, 4); return the keys (c,) of the cells that they went into, sorted."""
    cells, groups = _grouped_points(points, store.resolution)
    _insert_groups(store, cells, groups)
    return cells


def insert_blocks(store: BlockStore, blocks: Blocks) -> np.ndarray:
    """Insert blocks of the store's resolution, which may overlap; return the keys (c,) of their cells, sorted."""
    # Single precision would be compiled anew, for seconds, when the first loop closes.
    rows = blocks.rows.astype(np.float64, copy=False)
    cells, order, starts = _sorted_by_cell(blocks.keys, rows[:, BOTTOM])
    owner = np.repeat(np.arange(len(cells)), np.diff(starts))
    _insert_groups(store, cells, (rows[order], owner, blocks.crossed[order]))
    return cells


def _insert_groups(store: BlockStore, cells: np.ndarray, groups: _Groups) -> None:
    slots, held = store.places(cells)
    runs, fused = _merged_runs(groups, held, slots, store.resolution)
    store.write(slots, runs, fused)


@lru_cache(maxsize=None)
def compile_loops() -> None:
    """Compile all loops, or read them from numba's cache, once in a process: not when the first scan comes."""
    store = BlockStore(1.0)
    for writeable in (True, False):
        points = np.zeros((2, 4))
        points.flags.writeable = writeable
        kept, _ = admitted(points, 1.0)
    insert_points(store, kept)
    insert_blocks(store, store.blocks(store.rows_in_use))
    store.find(np.zeros(1, dtype=np.int64))
    store.remove(store.rows_in_use)


@compiled()
def _merged_runs(groups, held, slots, resolution):
    """Return the Runs of the cells at `slots` (c,) after _Groups went into them, each cell at least one, and the row
    numbers (f,) of stored blocks that are part of others by then.

    held: the store's arrays. A merged block keeps the highest row of its parts. What is new resets its crossings: a
    beam has just hit it.
    """
    (group_rows, group_cells, group_crossed), (rows, following, _, heads) = groups, held
    most = len(group_rows) + _stored_count(following, heads, slots)
    blocks, row, owner = np.empty((most, ROW_WIDTH)), np.empty(most, np.int64), np.empty(most, np.int64)
    crossed, changed = np.zeros(most, np.uint16), np.empty(most, np.bool_)
    parts, part_rows = np.empty((most, ROW_WIDTH)), np.empty(most, np.int64)
    stored, fused = np.empty(most, np.int64), np.empty(most, np.int64)
    made, gone, group = 0, 0, 0
    for cell in range(len(slots)):
        old = _stored_by_bottom(rows, following, heads[slots[cell]], stored)
        reached, length, looked_at = -np.inf, 0, 0
        while True:
            is_new = group < len(group_rows) and group_cells[group] == cell
            new_bottom = group_rows[group, BOTTOM] if is_new else np.inf
            old_bottom = rows[stored[looked_at], BOTTOM] if looked_at < old else np.inf
            bottom = min(new_bottom, old_bottom)
            if length and (bottom == np.inf or bottom - reached >= resolution):
                changed[made], owner[made] = length > 1 or part_rows[0] < 0, cell
                if changed[made]:
                    _pool(parts[:length], blocks[made])
                row[made], gone = _row_of(part_rows[:length], fused, gone)
                made, length, reached = made + 1, 0, -np.inf
            if bottom == np.inf:
                break
            if new_bottom <= old_bottom:
                parts[length], part_rows[length] = group_rows[group], -1
                crossed[made] = max(crossed[made], group_crossed[group])
                group += 1
            else:
                parts[length], part_rows[length] = rows[stored[looked_at]], stored[looked_at]
                looked_at += 1
            reached = max(reached, parts[length, TOP])
            length += 1
    return Runs(blocks[:made], row[:made], owner[:made], crossed[:made], changed[:made]), fused[:gone]


@compiled()
def _stored_count(following, heads, slots):
    """Return how many blocks the cells at `slots` (c,) hold."""
    count = 0
    for slot in slots:
        row = heads[slot]
        while row != NO_BLOCK:
            count += 1
            row = following[row]
    return count


@compiled()
def _stored_by_bottom(rows, following, head, stored):
    """Write the row numbers of a cell into `stored`, sorted by bottom, and return how many there are."""
    held, row = 0, head
    while row != NO_BLOCK:
        place = held
        while place > 0 and rows[stored[place - 1], BOTTOM] > rows[row, BOTTOM]:
            stored[place] = stored[place - 1]
            place -= 1
        stored[place] = row
        held += 1
        row = following[row]
    return held


@compiled()
def _pool(parts, block):
    """Write what intervals (p, ROW_WIDTH) make together into `block` (ROW_WIDTH,).

    Mean and variance are pooled exactly (Chan, Golub and LeVeque 1979); equation 6.6 of the thesis underestimates the
    variance.
    """
    block[:] = parts[0]
    if len(parts) == 1:
        return
    for part in range(1, len(parts)):
        block[COUNT] += parts[part, COUNT]
        block[TOP] = max(block[TOP], parts[part, TOP])
    for column in range(_VALUES):
        first, total, squares = parts[0, column], 0.0, 0.0
        for part in range(len(parts)):
            total += (parts[part, column] - first) * parts[part, COUNT]
        mean = first + total / block[COUNT]
        for part in range(len(parts)):
            shift = parts[part, column] - mean
            squares += parts[part, _VALUES + column] + shift * shift * parts[part, COUNT]
        block[column], block[_VALUES + column] = mean, squares


@compiled()
def _row_of(rows, fused, gone):
    """Return the highest of the stored rows (p,), -1 without one, and how many rows are free by now: the others too."""
    kept = np.int64(-1)
    for row in rows:
        kept = max(kept, row)
    for row in rows:
        if 0 <= row < kept:
            fused[gone] = row
            gone += 1
    return kept, gone


@compiled()
def _finite_within(points, limit):
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


def _grouped_points(points: np.ndarray, resolution: float) -> Tuple[np.ndarray, _Groups]:
    """Return the keys (c,) of the cells of points (n, 4), sorted, and the _Groups that they make by themselves."""
    cells, order, starts = _sorted_by_cell(keys_of(points, resolution), points[:, 2])
    return cells, _split_at_gaps(points, order, starts, resolution)


def _sorted_by_cell(cell: np.ndarray, height: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the keys (c,) in `cell` (n,), sorted; the order (n,) that sorts by cell, height (n,) and place in the
    array; and where each cell begins in that order (c + 1,).
    """
    order = np.lexsort((height, cell))
    keys = cell[order]
    starts = np.flatnonzero(np.diff(keys, prepend=keys[:1] - 1))
    return keys[starts], order, np.append(starts, len(keys))


@compiled()
def _split_at_gaps(points, order, starts, resolution):
    """Return the _Groups of points (n, 4) that are sorted by cell; order, starts: see _sorted_by_cell."""
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
    for column in range(_VALUES):
        # From one of the points on: a plain sum rounds, and the mean of points on a border would leave their cell.
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
