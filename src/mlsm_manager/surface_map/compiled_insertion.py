"""Insertion of points in compiled loops.

Each sum adds the same numbers in the same order as numpy does in `linkage`, so that the blocks are the same to the last
bit and in the same rows; only the time differs.
"""

from functools import lru_cache

import numpy as np

from mlsm_manager.surface_map.block_store import BlockStore
from mlsm_manager.surface_map.compiled_loops import grouped, merged, sorted_by_cell


def insert_points_compiled(store: BlockStore, points: np.ndarray, cell: np.ndarray, resolution: float) -> np.ndarray:
    """Insert points; see PointInserter."""
    points = np.ascontiguousarray(points)
    cells, order, first_points = sorted_by_cell(cell, np.ascontiguousarray(points[:, 2]))
    slots = store.slots(cells)
    groups, group_cell = grouped(points, order, first_points, resolution)
    blocks, rows, owner, changed, fused = merged(groups, group_cell, *store.chains(slots), resolution)
    if len(fused):
        store.release(fused)
    new = rows < 0
    rows[new] = store.take(int(np.count_nonzero(new)))
    # Points fell into all that changed: no beam crossed it since.
    store.write_rows(rows[changed], blocks[changed], np.uint16(0))
    store.chain(rows, owner, slots)
    return cells


@lru_cache(maxsize=None)
def compile_loops() -> None:
    """Compile all loops, or read them from numba's cache, once in a process: not when the first scan comes."""
    store = BlockStore(0)
    for dtype in (np.float64, np.float32):
        insert_points_compiled(store, np.zeros((2, 4), dtype), np.zeros(2, dtype=np.int64), 1.0)
