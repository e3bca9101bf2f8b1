"""The Multi Level Surface Map: a grid of cells, each with blocks at several heights (thesis 6.2, 6.5.6)."""

from dataclasses import dataclass
from typing import Sequence, Tuple

import numpy as np

from mlsm_manager.surface_map.block_store import BlockStore, RunningCopy
from mlsm_manager.surface_map.blocks import BOTTOM, TOP, Blocks
from mlsm_manager.surface_map.insertion import InsertReport, admitted, compile_loops, insert_blocks, insert_points
from node_support.geometry import cell_keys, cells_of, cells_of_keys, grid

_EXTENT = [0, 1, BOTTOM, TOP]  # columns of a block that tell where it lies

TILE_BITS = 4  # 16 cells on a side of a tile: larger ones repeat more that did not change, smaller ones slow rviz
_MOST_PARTS = 64  # insertions that are noted before what they changed is put together: it bounds memory


class ChangedTiles:
    """Collects the keys of tiles; tile (i, j) has the key of `cell_keys`."""

    def __init__(self) -> None:
        self._tiles, self._cells = np.empty(0, dtype=np.int64), []

    def note(self, keys: np.ndarray) -> None:
        """Note that cells with `keys` (n,) changed."""
        self._cells.append(keys)
        if len(self._cells) > _MOST_PARTS:
            self._tiles = self._together()

    def take(self) -> np.ndarray:
        """Return the (n, 2) int64 tiles that changed since the last call, sorted, none twice."""
        tiles, self._tiles = self._together(), self._tiles[:0]
        return cells_of_keys(tiles)

    def _together(self) -> np.ndarray:
        """Return the keys of all tiles noted so far, sorted, and keep no cells any more."""
        cells, self._cells = self._cells, []
        tiles = [cell_keys(cells_of_keys(keys) >> TILE_BITS) for keys in cells]
        return np.unique(np.concatenate([self._tiles, *tiles]))


class MultiLevelSurfaceMap:
    """Blocks found by cell.

    The cost of inserting a scan depends on the scan and on the blocks of the cells it touches, not on the map.
    """

    def __init__(self, resolution: float, limit: float = 10000.0, expected_blocks: int = 0) -> None:
        """`resolution`: side of a cell, m. Points beyond `limit` [m] from the origin in any axis are not inserted."""
        compile_loops()
        self.resolution = resolution
        self.limit = limit
        self._store = BlockStore(resolution, expected_blocks)
        self._changed = ChangedTiles()

    def __len__(self) -> int:
        return len(self._store)

    @property
    def nbytes(self) -> int:
        """Memory in use, bytes; what is reserved but not touched yet costs nothing and is not counted."""
        return self._store.nbytes

    @property
    def blocks(self) -> Blocks:
        return self._store.blocks(self._store.rows_in_use)

    def begin_copy(self) -> RunningCopy:
        """Return a copy of all blocks as they are now, which is still to be made; see `finished`."""
        return self._store.begin_copy()

    def in_box(self, low: np.ndarray, high: np.ndarray) -> Blocks:
        """Return a copy of the blocks whose mean lies between `low` and `high`, (2,) x y or (3,) x y z [m].

        None where a corner is no number or `low` is above `high`.
        The blocks come in the order in which `blocks` has them. The cost is that of the cells in the box.
        """
        low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
        if not (low <= high).all():
            return self._store.blocks(np.empty(0, dtype=np.int64))
        first, last = cells_of(np.clip([low, high], -self.limit, self.limit), self.resolution)
        width = last - first + 1
        if int(width[0]) * int(width[1]) > len(self):
            return self.blocks.in_box(low, high)
        x, y = (np.arange(width[axis]) + first[axis] for axis in (0, 1))
        rows, _ = self._store.find(((x << 32)[:, np.newaxis] + y).ravel())
        return self._store.blocks(np.sort(rows)).in_box(low, high)

    def in_tiles(self, tiles: np.ndarray) -> Blocks:
        """Return a copy of the blocks of tiles (n, 2), none twice, as `take_changed_tiles` names them."""
        within = grid(np.arange(1 << TILE_BITS))
        cells = (np.asarray(tiles, dtype=np.int64).reshape(-1, 1, 2) << TILE_BITS) + within
        rows, _ = self._store.find(cell_keys(cells.reshape(-1, 2)))
        return self._store.blocks(rows)

    def take_changed_tiles(self) -> np.ndarray:
        """Return the (n, 2) int64 tiles whose blocks changed since the last call, sorted.

        Tile (i, j) covers 2 ** TILE_BITS cells on a side. A count of crossings is no change.
        """
        return self._changed.take()

    def find(self, cells: np.ndarray) -> Tuple[Blocks, np.ndarray, np.ndarray]:
        """Return the blocks (m) of cells with keys `cells` (n,), the row of each (m,), and whose it is, (m,) indices.

        The rows are good for `count_crossings` and `remove`, until points are inserted or blocks removed.
        """
        rows, owners = self._store.find(cells)
        return self._store.blocks(rows), rows, owners

    def is_near(self, points: np.ndarray) -> np.ndarray:
        """Return which points (n, >= 2) lie in a cell that holds a block or adjoins one that does."""
        around = grid(np.array([-1, 0, 1]))
        cells = cells_of(points, self.resolution)[:, np.newaxis] + around
        _, owners = self._store.find(cell_keys(cells.reshape(-1, 2)))
        near = np.zeros(len(points), dtype=bool)
        near[owners // len(around)] = True
        return near

    def replace(self, parts: Sequence[Blocks]) -> None:
        """Forget all blocks, and insert those of all `parts`."""
        self.remove(self._store.rows_in_use)
        for blocks in parts:
            self.insert_blocks(blocks)

    def count_crossings(self, rows: np.ndarray, beams: np.ndarray) -> None:
        """Count `beams` (n,) more crossings of the blocks in `rows` (n,), none twice."""
        self._store.add_crossings(rows, beams)

    def remove(self, rows: np.ndarray) -> None:
        """Forget the blocks in `rows` (n,), none twice."""
        if len(rows):
            self._changed.note(self._store.remove(rows))

    def insert(self, points: np.ndarray) -> InsertReport:
        """Insert points (n, 4), x y z [m] and strength, in the map's frame, as one batch.

        Points that are not finite or beyond the limit are left out and counted.
        """
        kept, report = admitted(points, self.limit)
        self._changed.note(insert_points(self._store, kept))
        return report

    def insert_blocks(self, blocks: Blocks) -> None:
        """Insert blocks of the same resolution; each goes where its mean lies, as if its points came with it.

        Blocks with their mean, bottom or top beyond the limit are left out. Raises ValueError for another resolution.
        """
        if blocks.resolution != self.resolution:
            raise ValueError(f"resolution {blocks.resolution:g} m: must be the map's, {self.resolution:g} m")
        kept = blocks.take(np.abs(blocks.rows[:, _EXTENT]).max(axis=1) <= self.limit)
        self._changed.note(insert_blocks(self._store, kept))


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
        _, rows, _ = surface_map.find(cell_keys(self.cells))
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
        return Covered(cells_of_keys(self._cells), self._held.rows, self._held.crossed)

    def lay(self, blocks: Blocks) -> None:
        self._remember(blocks.keys)
        self._map.insert_blocks(blocks)

    def hide(self, blocks: Blocks, rows: np.ndarray) -> None:
        """Remove blocks of the map, which are in `rows` (n,) of it."""
        self._remember(blocks.keys)
        self._map.remove(rows)

    def take_off(self) -> None:
        """Give all changed cells what they held before."""
        if len(self._cells):
            self.covered.uncover(self._map)
            self._forget()

    def _remember(self, cells: np.ndarray) -> None:
        new = np.setdiff1d(cells, self._cells)
        held, _, _ = self._map.find(new)
        self._cells = np.union1d(self._cells, new)
        self._held = Blocks.joined([self._held, held])
