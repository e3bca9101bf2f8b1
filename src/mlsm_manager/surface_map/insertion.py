"""How points become blocks of a store, by numpy or by compiled loops that give the same blocks to the last bit."""

from typing import Callable, NamedTuple

import numpy as np

from mlsm_manager.surface_map.admission import InsertReport, admitted
from mlsm_manager.surface_map.block_store import BlockStore
from mlsm_manager.surface_map.blocks import cells_of
from mlsm_manager.surface_map.cell_index import cell_keys
from mlsm_manager.surface_map.linkage import Extents, Intervals, concatenated, group_points, joined, link, merge
from node_support.kernels import Kernel
from node_support.numba_cache import prepare_cache


class Insertion(NamedTuple):
    """cells: (c,) keys of the cells that points went into, sorted. report: what became of all points."""

    cells: np.ndarray
    report: InsertReport


PointInserter = Callable[[BlockStore, np.ndarray, float, float], Insertion]
"""Takes store, points (n, 4), the resolution and the limit of coordinates [m]."""


def point_inserter(kernel: Kernel) -> PointInserter:
    """Return what inserts points. Raises ImportError, which says what to install, for NUMBA without numba."""
    if kernel is Kernel.NUMPY:
        return insert_points
    prepare_cache()
    from mlsm_manager.surface_map.compiled_insertion import compile_loops, insert_points_compiled

    compile_loops()
    return insert_points_compiled


def insert_points(store: BlockStore, points: np.ndarray, resolution: float, limit: float) -> Insertion:
    """Insert points; see PointInserter."""
    kept, report = admitted(points, limit)
    if not len(kept):
        return Insertion(np.empty(0, dtype=np.int64), report)
    groups = group_points(kept, cell_keys(cells_of(kept, resolution)), resolution)
    return Insertion(insert_groups(store, groups, resolution), report)


def insert_groups(store: BlockStore, groups: Intervals, resolution: float) -> np.ndarray:
    """Insert sorted intervals that lie at least the resolution apart; return the keys (c,) of their cells, sorted."""
    cells = groups.cell[np.flatnonzero(np.append(True, groups.cell[1:] != groups.cell[:-1]))]
    slots = store.slots(cells)
    if len(store):
        rows, owner = _write_merged(store, groups, store.extents(cells, slots), resolution)
    else:
        rows, owner = store.take(len(groups)), groups.cell
        store.write(rows, groups)
    store.chain(rows, owner, slots)
    return cells


def _write_merged(store: BlockStore, groups: Intervals, stored: Extents, resolution: float) -> tuple:
    """Write what new and stored intervals make together; return rows and cells of all that their cells hold now.

    Most of what lies in the cells of a scan stays as it is, or is new and touches nothing: it is never read.
    """
    elements = concatenated(groups.extents, stored)
    starts = link(elements, resolution)
    size = np.diff(np.append(starts, len(elements)))
    alone, several = (elements.row[starts] < 0) & (size == 1), size > 1
    number = np.cumsum(elements.row < 0) - 1
    single = groups.take(number[starts[alone]])
    together = _merged(store, groups, elements, number, size) if several.any() else None
    rows = _rows_of_runs(store, elements, starts, size)
    store.write(rows[alone], single)
    if together is not None:
        store.write(rows[several], together)
    return rows, elements.cell[starts]


def _rows_of_runs(store: BlockStore, elements: Extents, starts: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the row (m,) of each run: the highest of its stored blocks, the others are given back, or else a new one.

    What was stored must have been read before.
    """
    rows = np.maximum.reduceat(elements.row, starts)
    fused = (elements.row >= 0) & (elements.row != np.repeat(rows, size))
    if fused.any():
        store.release(elements.row[fused])
    new = rows < 0
    rows[new] = store.take(int(np.count_nonzero(new)))
    return rows


def _merged(store: BlockStore, groups: Intervals, elements: Extents, number: np.ndarray, size: np.ndarray) -> Intervals:
    """Return what runs of several elements make together. number: (n,) of the group that each new element is."""
    several = size > 1
    members = np.flatnonzero(np.repeat(several, size))
    is_new = elements.row[members] < 0
    held = store.intervals(elements.take(members[~is_new]))
    parts = joined(groups.take(number[members[is_new]]), held)
    place = np.where(is_new, np.cumsum(is_new) - 1, len(parts) - len(held) + np.cumsum(~is_new) - 1)
    return merge(parts.take(place), np.cumsum(size[several]) - size[several])
