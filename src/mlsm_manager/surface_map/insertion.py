"""How points become blocks of a store, by numpy or by compiled loops that give the same blocks to the last bit."""

from enum import Enum
from typing import Callable

import numpy as np

from mlsm_manager.surface_map.block_store import BlockStore
from mlsm_manager.surface_map.linkage import Intervals, concatenated, group_points, link, merge

PointInserter = Callable[[BlockStore, np.ndarray, np.ndarray, float], np.ndarray]
"""Takes store, points (n, 4), n > 0, the keys of their cells (n,) and the resolution; returns these keys, sorted."""


class InsertionKernel(Enum):
    """What inserts points."""

    NUMPY = "NUMPY"
    NUMBA = "NUMBA"


def point_inserter(kernel: InsertionKernel) -> PointInserter:
    """Return what inserts points. Raises ImportError, which says what to install, for NUMBA without numba."""
    if kernel is InsertionKernel.NUMPY:
        return insert_points
    from mlsm_manager.surface_map.compiled_insertion import insert_points_compiled

    return insert_points_compiled


def insert_points(store: BlockStore, points: np.ndarray, cell: np.ndarray, resolution: float) -> np.ndarray:
    """Insert points; see PointInserter."""
    return insert_groups(store, group_points(points, cell, resolution), resolution)


def insert_groups(store: BlockStore, groups: Intervals, resolution: float) -> np.ndarray:
    """Insert sorted intervals that lie at least the resolution apart; return the keys of their cells, sorted."""
    cells = groups.cell[np.flatnonzero(np.append(True, groups.cell[1:] != groups.cell[:-1]))]
    slots = store.slots(cells)
    if not len(store):
        rows = store.take(len(groups))
        store.write(rows, groups)
    else:
        elements = concatenated(groups, store.stored(cells, slots))
        rows, groups = _write_merged(store, elements, resolution)
    store.chain(rows, groups.cell, slots)
    return cells


def _write_merged(store: BlockStore, elements: Intervals, resolution: float) -> tuple:
    """Write what new and stored intervals make together; return rows and intervals of all that their cells hold now."""
    starts = link(elements, resolution)
    merged = merge(elements, starts)
    size = np.diff(np.append(starts, len(elements)))
    fused = (elements.row >= 0) & (elements.row != np.repeat(merged.row, size))
    if fused.any():
        store.release(elements.row[fused])
    rows = merged.row.copy()
    new = rows < 0
    rows[new] = store.take(int(np.count_nonzero(new)))
    changed = new | (size > 1)
    store.write(rows[changed], merged.take(changed))
    return rows, merged
