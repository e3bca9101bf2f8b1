"""Blocks that lie on a map for a while and can be taken off again."""

from dataclasses import dataclass

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.cell_index import cell_keys, cells_of_keys
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap


@dataclass(frozen=True)
class Covered:
    """What a map holds below an overlay.

    cells: (n, 2) int64 that the overlay changes. rows: (m, 11), crossed: (m,) of the blocks in them, see Blocks.
    """

    cells: np.ndarray
    rows: np.ndarray
    crossed: np.ndarray

    def uncover(self, surface_map: MultiLevelSurfaceMap) -> None:
        """Give these cells of a map what they held before."""
        _, rows, _ = surface_map.find(self.cells)
        surface_map.remove(rows)
        surface_map.insert_blocks(Blocks(self.rows, surface_map.resolution, self.crossed))


class Overlay:
    """Changes cells of a map and remembers what they held. The cost is that of the changed cells."""

    def __init__(self, surface_map: MultiLevelSurfaceMap) -> None:
        self._map = surface_map
        self._forget()

    def _forget(self) -> None:
        self._cells = np.empty(0, dtype=np.int64)
        self._held = Blocks.none(self._map.resolution)

    @property
    def covered(self) -> Covered:
        """What the changed cells held before."""
        return Covered(cells_of_keys(self._cells), self._held.rows, self._held.crossed)

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
        if not len(self._cells):
            return
        self.covered.uncover(self._map)
        self._forget()

    def _remember(self, cells: np.ndarray) -> None:
        new = np.setdiff1d(cell_keys(cells), self._cells)
        held, _, _ = self._map.find(cells_of_keys(new))
        self._cells = np.union1d(self._cells, new)
        self._held = Blocks.joined([self._held, held])
