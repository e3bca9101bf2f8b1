"""Where a map keeps its blocks: one float64 row each, found through the first block of their cell and a chain."""

from typing import Tuple
from weakref import WeakSet

import numpy as np

from mlsm_manager.surface_map.blocks import BOTTOM, COUNT, MEAN, MOST_CROSSINGS, ROW_WIDTH, SQUARES, TOP, Blocks
from mlsm_manager.surface_map.cell_index import NO_BLOCK, CellIndex
from mlsm_manager.surface_map.large_array import LargeArray
from mlsm_manager.surface_map.linkage import Extents, Intervals
from mlsm_manager.surface_map.running_copy import RunningCopy
from node_support.kernels import Kernel
from node_support.numba_cache import prepare_cache

_MIN_ROWS = 1024
"""Reserved from the start (96 kB), so that small maps do not grow scan by scan."""


def cell_index(expected_cells: int, kernel: Kernel) -> CellIndex:
    """Return an empty index. Raises ImportError, which says what to install, for NUMBA without numba."""
    if kernel is Kernel.NUMPY:
        return CellIndex(expected_cells)
    prepare_cache()
    from mlsm_manager.surface_map.compiled_index import CompiledCellIndex

    return CompiledCellIndex(expected_cells)


class BlockStore:
    """Rows, the chain of each cell and the rows that are free. All access is by whole arrays."""

    def __init__(self, expected_blocks: int, kernel: Kernel = Kernel.NUMPY) -> None:
        """`expected_blocks`: room is reserved for so many. kernel: of the search for cells."""
        reserved = max(expected_blocks, _MIN_ROWS)
        self._row_array = LargeArray(reserved, (ROW_WIDTH,), np.float64)
        self._next_array = LargeArray(reserved, (), np.int32)
        self._crossed_array = LargeArray(reserved, (), np.uint16)
        self._index = cell_index(expected_blocks, kernel)
        self._used = 0
        self._free = np.empty(0, dtype=np.int64)
        self._copies: WeakSet[RunningCopy] = WeakSet()

    def __len__(self) -> int:
        return self._used - len(self._free)

    @property
    def _rows(self) -> np.ndarray:
        return self._row_array.values

    @property
    def _next(self) -> np.ndarray:
        return self._next_array.values

    @property
    def _crossed(self) -> np.ndarray:
        return self._crossed_array.values

    @property
    def nbytes(self) -> int:
        """Memory in use, bytes; rows beyond those are reserved but never touched, so that they cost nothing yet."""
        per_block = self._rows.itemsize * ROW_WIDTH + self._next.itemsize + self._crossed.itemsize
        return self._used * per_block + self._index.nbytes

    @property
    def rows_in_use(self) -> np.ndarray:
        """(n,) numbers of all rows that hold a block, increasing."""
        return np.flatnonzero(self._rows[: self._used, COUNT])

    def blocks(self, rows: np.ndarray, resolution: float) -> Blocks:
        """Return a copy of the blocks in `rows` (n,)."""
        return Blocks(self._rows[rows], resolution, self._crossed[rows])

    def begin_copy(self, resolution: float) -> RunningCopy:
        """Return a copy of all blocks as they are now, which is still to be made."""
        copy = RunningCopy(self._row_array, self._crossed_array, self._used, resolution)
        self._copies.add(copy)
        return copy

    @property
    def arrays(self) -> Tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Views to write to: rows, the row that follows each in its cell, crossings, and the first rows of all cells.

        Of n rows and s places for cells they are (n, ROW_WIDTH), (n,), (n,) and (s,). Who changes a row tells
        `announce` before.
        """
        return self._rows, self._next, self._crossed, self._index.heads

    def announce(self, rows: np.ndarray, changed: np.ndarray) -> None:
        """Learn that those of `rows` (n,) that are `changed` (n,) will be written to."""
        if self._copies:
            self._before_change(rows[changed])

    def _before_change(self, rows: np.ndarray) -> None:
        for copy in self._copies:
            copy.before_change(rows)

    def slots(self, cells: np.ndarray) -> np.ndarray:
        """Return (n,) the places of cells with keys `cells` (n,), none twice, in the index; new cells get one."""
        return self._index.slots(cells)

    def extents(self, cells: np.ndarray, slots: np.ndarray) -> Extents:
        """Return those of all blocks of cells with keys `cells` (n,) at `slots` (n,)."""
        owners, rows = self._followed(cells, self._index.heads[slots])
        return Extents(owners, self._rows[rows, BOTTOM], self._rows[rows, TOP], rows)

    def intervals(self, extents: Extents) -> Intervals:
        """Return the blocks whose extents are known, with the statistics of their points."""
        data = self._rows[extents.row]
        return Intervals(
            extents.cell, extents.bottom, extents.top, extents.row, data[:, COUNT], data[:, MEAN], data[:, SQUARES],
            self._crossed[extents.row],
        )  # fmt: skip

    def chains(self, slots: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return views of all rows and of the row that follows each in its cell, and the first rows of cells (n,)."""
        return self._rows, self._next, self._index.heads[slots]

    def find(self, cells: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return row numbers (m,) of all blocks of cells with keys `cells` (n,), and whose they are, (m,) indices."""
        owners, rows = self._followed(np.arange(len(cells)), self._index.find(cells))
        return rows, owners

    def release(self, rows: np.ndarray) -> None:
        """Give back rows (n,); the chain must be told by `chain`."""
        self._before_change(rows)
        self._rows[rows, COUNT] = 0.0
        self._free = np.concatenate([self._free, rows])

    def take(self, number: int) -> np.ndarray:
        """Return the numbers (number,) of rows that are free now, growing where none are."""
        reused, self._free = self._free[:number], self._free[number:]
        first, self._used = self._used, self._used + number - len(reused)
        for array in (self._row_array, self._next_array, self._crossed_array):
            array.reserve(self._used)
        return np.concatenate([reused, np.arange(first, self._used)])

    def write(self, rows: np.ndarray, intervals: Intervals) -> None:
        """Write intervals (n) into `rows` (n,)."""
        data = np.empty((len(rows), ROW_WIDTH))
        data[:, MEAN] = intervals.mean
        data[:, SQUARES] = intervals.squares
        data[:, COUNT] = intervals.count
        data[:, BOTTOM] = intervals.bottom
        data[:, TOP] = intervals.top
        self.write_rows(rows, data, intervals.crossed)

    def write_rows(self, rows: np.ndarray, data: np.ndarray, crossed: np.ndarray) -> None:
        """Write data (n, ROW_WIDTH) and crossings (n,), or one number for all, into `rows` (n,)."""
        self._before_change(rows)
        self._rows[rows] = data
        self._crossed[rows] = crossed

    def add_crossings(self, rows: np.ndarray, beams: np.ndarray) -> None:
        """Count `beams` (n,) more crossings of the blocks at `rows` (n,), none twice."""
        self._before_change(rows)
        self._crossed[rows] = np.minimum(self._crossed[rows] + beams, MOST_CROSSINGS)

    def chain(self, rows: np.ndarray, cell: np.ndarray, slots: np.ndarray) -> None:
        """Make `rows` (n,) of cells with keys `cell` (n,), grouped, all that the cells at `slots` hold."""
        same_cell = np.append(cell[1:] == cell[:-1], False)
        self._next[rows] = np.where(same_cell, np.append(rows[1:], NO_BLOCK), NO_BLOCK)
        first = np.append(True, ~same_cell[:-1])
        self._index.heads[slots] = rows[first]

    def empty(self, slots: np.ndarray) -> None:
        """Let the cells at `slots` (n,) hold nothing."""
        self._index.heads[slots] = NO_BLOCK

    def _followed(self, owners: np.ndarray, heads: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return owners and row numbers of all blocks that chains from `heads` (n,) lead to."""
        found_owners, found_rows = [owners[:0]], [np.empty(0, dtype=np.int64)]
        row = heads.astype(np.int64)
        while True:
            present = row != NO_BLOCK
            row, owners = row[present], owners[present]
            if not row.size:
                return np.concatenate(found_owners), np.concatenate(found_rows)
            found_rows.append(row)
            found_owners.append(owners)
            row = self._next[row].astype(np.int64)
