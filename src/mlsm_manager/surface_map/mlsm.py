"""The Multi Level Surface Map: a grid of cells, each with blocks at several heights (thesis 6.2, 6.5.6)."""

from dataclasses import dataclass

import numpy as np

from mlsm_manager.surface_map.blocks import BOTTOM, COUNT, MEAN, ROW_WIDTH, SQUARES, TOP, Blocks, cells_of
from mlsm_manager.surface_map.cell_index import NO_BLOCK, CellIndex, cell_keys
from mlsm_manager.surface_map.linkage import Intervals, concatenated, group_points, link, merge

# Of 88 bytes: a small map grows a few times only.
_MIN_ROWS = 1024


@dataclass(frozen=True)
class InsertReport:
    """What became of the points of one insertion."""

    inserted: int
    not_finite: int
    outside: int


class MultiLevelSurfaceMap:
    """Blocks in one float64 row each, found through the first block of their cell and a chain from there.

    The cost of inserting a scan depends on the scan and on the blocks of the cells it touches, not on the map.
    """

    def __init__(self, resolution: float, limit: float = 10000.0, expected_blocks: int = 0) -> None:
        """`resolution`: side of a cell, m. Points beyond `limit` [m] from the origin in any axis are not inserted."""
        self.resolution = resolution
        self.limit = limit
        self._rows = np.empty((max(expected_blocks, _MIN_ROWS), ROW_WIDTH))
        self._next = np.empty(len(self._rows), dtype=np.int32)
        self._index = CellIndex(expected_blocks)
        self._used = 0
        self._free = np.empty(0, dtype=np.int64)

    def __len__(self) -> int:
        """Return the number of blocks."""
        return self._used - len(self._free)

    @property
    def nbytes(self) -> int:
        """Memory in use, bytes; rows beyond those are reserved but never touched, so that they cost nothing yet."""
        return self._used * (self._rows.itemsize * ROW_WIDTH + self._next.itemsize) + self._index.nbytes

    @property
    def blocks(self) -> Blocks:
        """A copy of all blocks, in no particular order."""
        rows = self._rows[: self._used]
        return Blocks(rows[rows[:, COUNT] > 0], self.resolution)

    def insert(self, points: np.ndarray) -> InsertReport:
        """Insert points (n, 4), x y z [m] and strength, in the map's frame, as one batch.

        Points that are not finite or beyond the limit are left out and counted.
        """
        points = np.asarray(points, dtype=np.float64)
        finite = np.isfinite(points).all(axis=1)
        with np.errstate(invalid="ignore"):
            inside = (np.abs(points[:, :3]) <= self.limit).all(axis=1)
        keep = finite & inside
        kept = points if keep.all() else points[keep]
        if len(kept):
            self._insert_groups(group_points(kept, cell_keys(cells_of(kept, self.resolution)), self.resolution))
        not_finite = len(points) - int(np.count_nonzero(finite))
        return InsertReport(len(kept), not_finite, len(points) - len(kept) - not_finite)

    def _insert_groups(self, groups: Intervals) -> None:
        cells = groups.cell[np.flatnonzero(np.append(True, groups.cell[1:] != groups.cell[:-1]))]
        slots = self._index.slots(cells)
        elements = concatenated(groups, self._stored(cells, slots))
        starts = link(elements, self.resolution)
        merged = merge(elements, starts)
        size = np.diff(np.append(starts, len(elements)))
        self._release(elements, merged, np.repeat(np.arange(len(starts)), size))
        rows = merged.row.copy()
        new = rows < 0
        rows[new] = self._take_rows(int(np.count_nonzero(new)))
        self._write(rows, merged, changed=new | (size > 1))
        self._chain(rows, merged.cell, slots)

    def _stored(self, cells: np.ndarray, slots: np.ndarray) -> Intervals:
        rows, owners = [], []
        row = self._index.heads[slots].astype(np.int64)
        owner = cells
        while True:
            present = row != NO_BLOCK
            row, owner = row[present], owner[present]
            if not row.size:
                break
            rows.append(row)
            owners.append(owner)
            row = self._next[row].astype(np.int64)
        all_rows = np.concatenate(rows) if rows else np.empty(0, dtype=np.int64)
        owner = np.concatenate(owners) if owners else np.empty(0, dtype=np.int64)
        data = self._rows[all_rows]
        return Intervals(
            owner, data[:, BOTTOM], data[:, TOP], data[:, COUNT], data[:, MEAN], data[:, SQUARES], all_rows
        )

    def _release(self, elements: Intervals, merged: Intervals, run: np.ndarray) -> None:
        fused = (elements.row >= 0) & (elements.row != merged.row[run])
        if fused.any():
            self._rows[elements.row[fused], COUNT] = 0
            self._free = np.concatenate([self._free, elements.row[fused]])

    def _take_rows(self, number: int) -> np.ndarray:
        reused, self._free = self._free[:number], self._free[number:]
        first, self._used = self._used, self._used + number - len(reused)
        if self._used > len(self._rows):
            capacity = max(2 * len(self._rows), self._used)
            self._rows = _grown(self._rows, first, capacity)
            self._next = _grown(self._next, first, capacity)
        return np.concatenate([reused, np.arange(first, self._used)])

    def _write(self, rows: np.ndarray, merged: Intervals, changed: np.ndarray) -> None:
        data = np.empty((len(rows), ROW_WIDTH))
        data[:, MEAN] = merged.mean
        data[:, SQUARES] = merged.squares
        data[:, COUNT] = merged.count
        data[:, BOTTOM] = merged.bottom
        data[:, TOP] = merged.top
        self._rows[rows[changed]] = data[changed]

    def _chain(self, rows: np.ndarray, cell: np.ndarray, slots: np.ndarray) -> None:
        same_cell = np.append(cell[1:] == cell[:-1], False)
        self._next[rows] = np.where(same_cell, np.append(rows[1:], NO_BLOCK), NO_BLOCK)
        first = np.append(True, ~same_cell[:-1])
        self._index.heads[slots] = rows[first]


def _grown(array: np.ndarray, used: int, capacity: int) -> np.ndarray:
    result = np.empty((capacity, *array.shape[1:]), dtype=array.dtype)
    result[:used] = array[:used]
    return result
