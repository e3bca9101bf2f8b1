"""Which parts of a map changed since somebody last asked: the map in square tiles of cells."""

from typing import List

import numpy as np

from mlsm_manager.surface_map.cell_index import cell_keys, cells_of_keys

TILE_BITS = 4
"""A tile has 2 ** 4 = 16 cells on a side: 8 m at 0.5 m. Larger ones repeat more that did not change, smaller ones make
more markers than rviz draws fluidly."""
_MOST_PARTS = 64
"""So many insertions are noted before what they changed is put together; it bounds the memory of a map unasked."""


class ChangedTiles:
    """Collects the keys of tiles; tile (i, j) has the key of `cell_keys`."""

    def __init__(self) -> None:
        self._parts: List[np.ndarray] = []

    def note(self, keys: np.ndarray) -> None:
        """Note that cells with `keys` (n,) changed."""
        tiles = cell_keys(cells_of_keys(keys) >> TILE_BITS)
        self._parts.append(np.unique(tiles))
        if len(self._parts) > _MOST_PARTS:
            self._parts = [np.unique(np.concatenate(self._parts))]

    def take(self) -> np.ndarray:
        """Return the (n, 2) int64 tiles that changed since the last call, sorted, none twice."""
        parts, self._parts = self._parts, []
        keys = np.unique(np.concatenate(parts)) if parts else np.empty(0, dtype=np.int64)
        return cells_of_keys(keys)
