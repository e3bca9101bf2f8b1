"""Blocks that lie on a map for a while and can be taken off again."""

import numpy as np

from mlsm_manager.surface_map.blocks import ROW_WIDTH, Blocks, concatenated_blocks
from mlsm_manager.surface_map.cell_index import cell_keys, cells_of_keys
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap


class Overlay:
    """Changes cells of a map and remembers what they held. The cost is that of the changed cells."""

    def __init__(self, surface_map: MultiLevelSurfaceMap) -> None:
        self._map = surface_map
        self._forget()

    def _forget(self) -> None:
        self._cells = np.empty(0, dtype=np.int64)
        self._held = Blocks(np.empty((0, ROW_WIDTH)), self._map.resolution)

    @property
    def cells(self) -> np.ndarray:
        """(n, 2) int64 the cells that are changed."""
        return cells_of_keys(self._cells)

    @property
    def held(self) -> Blocks:
        """What the changed cells held before."""
        return self._held

    def lay(self, blocks: Blocks) -> None:
        """Insert blocks into the map."""
        self._remember(blocks.cells)
        self._map.insert_blocks(blocks)

    def hide(self, rows: np.ndarray) -> None:
        """Remove the blocks in `rows` (n,) of the map."""
        self._remember(self._map.at(rows).cells)
        self._map.remove(rows)

    def take_off(self) -> None:
        """Give all changed cells what they held before."""
        _, rows, _ = self._map.find(self.cells)
        self._map.remove(rows)
        self._map.insert_blocks(self._held)
        self._forget()

    def _remember(self, cells: np.ndarray) -> None:
        new = np.setdiff1d(cell_keys(cells), self._cells)
        held, _, _ = self._map.find(cells_of_keys(new))
        self._cells = np.union1d(self._cells, new)
        self._held = concatenated_blocks(self._held, held)
