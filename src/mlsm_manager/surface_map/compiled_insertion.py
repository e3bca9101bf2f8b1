"""Insertion of points in compiled loops.

Each sum adds the same numbers in the same order as numpy does in `linkage`, so that the blocks are the same to the last
bit and in the same rows; only the time differs.
"""

from functools import lru_cache

import numpy as np

from mlsm_manager.surface_map.admission import InsertReport
from mlsm_manager.surface_map.block_store import BlockStore
from mlsm_manager.surface_map.compiled_loops import groups_of, merged, write_blocks
from mlsm_manager.surface_map.insertion import Insertion
from node_support.kernels import Kernel


def insert_points_compiled(store: BlockStore, points: np.ndarray, resolution: float, limit: float) -> Insertion:
    """Insert points; see PointInserter."""
    cells, groups, owner, inserted, not_finite = groups_of(np.ascontiguousarray(points), resolution, limit)
    report = InsertReport(inserted, not_finite, len(points) - inserted - not_finite)
    slots = store.slots(cells)
    blocks, rows, owner, changed, fused = merged(groups, owner, *store.chains(slots), resolution)
    if len(fused):
        store.release(fused)
    new = rows < 0
    rows[new] = store.take(int(np.count_nonzero(new)))
    store.announce(rows, changed)
    write_blocks(blocks, rows, owner, changed, slots, *store.arrays)
    return Insertion(cells, report)


@lru_cache(maxsize=None)
def compile_loops() -> None:
    """Compile all loops, or read them from numba's cache, once in a process: not when the first scan comes."""
    store = BlockStore(0, Kernel.NUMBA)
    for dtype in (np.float64, np.float32):
        for writeable in (True, False):
            points = np.zeros((2, 4), dtype)
            points.flags.writeable = writeable
            insert_points_compiled(store, points, 1.0, 1.0)
    store.find(np.zeros(1, dtype=np.int64))
