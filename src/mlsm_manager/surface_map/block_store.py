"""Where a map keeps its blocks: one float64 row each, found through the first block of their cell and a chain."""

import time
from threading import RLock
from typing import List, NamedTuple, Tuple
from weakref import WeakSet

import numpy as np

from mlsm_manager.surface_map.blocks import COUNT, MOST_CROSSINGS, ROW_WIDTH, Blocks
from node_support.geometry import keys_of
from node_support.numba_cache import compiled

_PIECE = 1 << 15  # rows copied at once: 3 MB, one or two milliseconds
_PAUSE = 0.001  # s between two pieces: a lock that is taken again at once is never given to somebody who waits for it
_MIN_ROWS = 1024  # reserved from the start (96 kB), so that small maps do not grow scan by scan


NO_BLOCK = -1
_EMPTY = np.iinfo(np.int64).min
_FEWEST_PLACES = 1 << 10
_MOST_LOAD = 0.75  # share of the places in use from which on the table doubles: a search then takes some steps
# The golden ratio times 2^64, a prime of xxHash and one of splitmix64: they spread neighbouring cells over the table.
_MULTIPLIER_X = np.uint64(0x9E3779B97F4A7C15)
_MULTIPLIER_Y = np.uint64(0xC2B2AE3D27D4EB4F)
_FINISHER = np.uint64(0xBF58476D1CE4E5B9)
_HALF, _LOW = np.uint64(32), np.int64(0xFFFFFFFF)


class Runs(NamedTuple):
    """All blocks (m) of the cells that something went into, by cell, then by bottom.

    blocks: (m, ROW_WIDTH), of which only those that changed are filled in. row: (m,) number in the store, -1 where new.
    cell: (m,) index of the cell. crossed: (m,) uint16, see Blocks. changed: (m,) bool.
    """

    blocks: np.ndarray
    row: np.ndarray
    cell: np.ndarray
    crossed: np.ndarray
    changed: np.ndarray


class CellIndex:
    """An open-addressing hash table from cell keys to block numbers.

    A hash and not tiles: walls cross a tile in a line and a far point needs one of its own, so that on real scans
    tiles spend more memory on empty cells than the blocks themselves take. Doubling takes some hundredths of a second
    at a million cells.

    keys: (s,) of the cell in each place. heads: (s,) the number of the first block of that cell, NO_BLOCK where there
    is none.
    """

    def __init__(self, expected_cells: int) -> None:
        self._begin(expected_cells)

    def _begin(self, cells: int) -> None:
        """Begin an empty table with room for so many cells, whose number of places is a power of two."""
        places = max(_FEWEST_PLACES, 1 << int(np.ceil(cells / _MOST_LOAD)).bit_length())
        self.keys, self.heads = np.full(places, _EMPTY), np.full(places, NO_BLOCK, dtype=np.int32)
        self._used = 0

    def slots(self, keys: np.ndarray) -> np.ndarray:
        """Return (n,) int64 places in `heads`, making those that are new; keys is (n,) and holds none twice.

        Places are good until the next call.
        """
        most = _MOST_LOAD * len(self.keys)
        if self._used + len(keys) > most:
            cells = self._used + _placed(keys, self.keys, False)[1]
            if cells > most:
                taken = self.keys != _EMPTY
                held_keys, heads = self.keys[taken], self.heads[taken]
                self._begin(cells)
                held_places, self._used = _placed(held_keys, self.keys, True)
                self.heads[held_places] = heads
        places, new = _placed(keys, self.keys, True)
        self._used += new
        return places

    def find(self, keys: np.ndarray) -> np.ndarray:
        """Return (n,) int32 `heads` of the cells with `keys` (n,), NO_BLOCK where there is none; makes none."""
        places, _ = _placed(np.ascontiguousarray(keys), self.keys, False)
        return np.where(places >= 0, self.heads[places], np.int32(NO_BLOCK))


@compiled()
def _searched(key, held_keys):
    """Return the place that holds a key, or else the free one that it may take: places are searched in a ring."""
    x, y = np.uint64(key >> 32), np.uint64(key & _LOW)
    mixed = x * _MULTIPLIER_X + y * _MULTIPLIER_Y
    mixed = (mixed ^ (mixed >> _HALF)) * _FINISHER
    last = len(held_keys) - 1
    place = np.int64(mixed >> _HALF) & last
    while held_keys[place] != key and held_keys[place] != _EMPTY:
        place = (place + 1) & last
    return place


@compiled()
def _placed(keys, held_keys, takes_new):
    """Return (n,) the places of `keys` (n,), and how many of these are new: they take one where asked to, -1 if not."""
    places, new = np.empty(len(keys), np.int64), 0
    for number in range(len(keys)):
        place = _searched(keys[number], held_keys)
        places[number] = place
        if held_keys[place] == _EMPTY:
            new += 1
            if takes_new:
                held_keys[place] = keys[number]
            else:
                places[number] = -1
    return places, new


class BlockStore:
    """Rows, the chain of each cell and the rows that are free. All access is by whole arrays."""

    def __init__(self, resolution: float, expected_blocks: int = 0) -> None:
        """`resolution`: side of a cell, m. `expected_blocks`: room is reserved for so many."""
        self.resolution = resolution
        reserved = max(expected_blocks, _MIN_ROWS)
        self._rows = np.empty((reserved, ROW_WIDTH))
        self._following = np.empty(reserved, dtype=np.int32)
        self._crossed = np.empty(reserved, dtype=np.uint16)
        self._index = CellIndex(expected_blocks)
        self._used = 0
        self._free = np.empty(0, dtype=np.int64)
        self._copies: WeakSet[RunningCopy] = WeakSet()

    def __len__(self) -> int:
        return self._used - len(self._free)

    @property
    def nbytes(self) -> int:
        """Memory in use, bytes; rows beyond those are reserved but never touched, so that they cost nothing yet."""
        of_row = sum(array[0].nbytes for array in (self._rows, self._following, self._crossed))
        return self._used * of_row + self._index.keys.nbytes + self._index.heads.nbytes

    @property
    def rows_in_use(self) -> np.ndarray:
        """(n,) numbers of all rows that hold a block, increasing."""
        return np.flatnonzero(self._rows[: self._used, COUNT])

    def blocks(self, rows: np.ndarray) -> Blocks:
        """Return a copy of the blocks in `rows` (n,)."""
        return Blocks(self._rows[rows], self.resolution, self._crossed[rows])

    def begin_copy(self) -> "RunningCopy":
        """Return a copy of all blocks as they are now, which is still to be made."""
        copy = RunningCopy(self._rows, self._crossed, self._used, self.resolution)
        self._copies.add(copy)
        return copy

    @property
    def _arrays(self) -> Tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        return (self._rows, self._following, self._crossed, self._index.heads)

    def places(self, cells: np.ndarray) -> Tuple[np.ndarray, Tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """Return (n,) the places of cells with keys `cells` (n,), none twice, and all arrays for compiled loops.

        New cells get a place. The arrays are good until the store grows: the blocks (n, ROW_WIDTH), the row (n,) that
        follows each in its cell, what crossed them (n,), and the first rows (s,) of all cells, where the places are.
        """
        return self._index.slots(cells), self._arrays

    def find(self, cells: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return row numbers (m,) of all blocks of cells with keys `cells` (n,), and whose they are, (m,) indices."""
        owners, row = np.arange(len(cells)), self._index.find(cells)
        found_rows, found_owners = [], []
        while row.size:
            present = row != NO_BLOCK
            row, owners = row[present], owners[present]
            found_rows.append(row)
            found_owners.append(owners)
            row = self._following[row]
        if not found_rows:
            return np.empty(0, dtype=np.int64), owners
        return np.concatenate(found_rows).astype(np.int64), np.concatenate(found_owners)

    def write(self, slots: np.ndarray, runs: Runs, fused: np.ndarray) -> None:
        """Put Runs into the cells at `slots` (c,) in place of what they hold; the rows `fused` (f,) are free then."""
        self._release(fused)
        new = runs.row < 0
        runs.row[new] = self._take(int(np.count_nonzero(new)))
        self._announce(runs.row[runs.changed])
        _write(runs[:-1], runs.changed, self._arrays, slots)

    def remove(self, rows: np.ndarray) -> np.ndarray:
        """Forget the blocks in `rows` (n,), none twice; return the keys (c,) of their cells, sorted."""
        cells = np.unique(keys_of(self._rows[rows], self.resolution))
        self._release(rows)
        slots, held = self.places(cells)
        _unlink_released(held, slots)
        return cells

    def _announce(self, rows: np.ndarray) -> None:
        """Tell the running copies that `rows` (n,) will be written to."""
        for copy in self._copies:
            copy.before_change(rows)

    def _release(self, rows: np.ndarray) -> None:
        """Give back rows (n,), to which no cell may lead afterwards."""
        if len(rows):
            self._announce(rows)
            self._rows[rows, COUNT] = 0.0
            self._free = np.concatenate([self._free, rows])

    def _take(self, number: int) -> np.ndarray:
        """Return the numbers (number,) of rows that are free now, growing where none are."""
        reused, self._free = self._free[:number], self._free[number:]
        first, self._used = self._used, self._used + number - len(reused)
        if self._used > len(self._rows):
            arrays = self._rows, self._following, self._crossed
            self._rows, self._following, self._crossed = (_longer(array, self._used) for array in arrays)
        return np.concatenate([reused, np.arange(first, self._used)])

    def add_crossings(self, rows: np.ndarray, beams: np.ndarray) -> None:
        """Count `beams` (n,) more crossings of the blocks at `rows` (n,), none twice."""
        self._announce(rows)
        self._crossed[rows] = np.minimum(self._crossed[rows] + beams, MOST_CROSSINGS)


def _longer(array: np.ndarray, length: int) -> np.ndarray:
    """Return an array of at least `length` rows, and twice as many as `array` (n, ...), whose rows are the first."""
    longer = np.empty((max(length, 2 * len(array)), *array.shape[1:]), dtype=array.dtype)
    longer[: len(array)] = array
    return longer


@compiled()
def _write(runs, changed, held, slots):
    """Write Runs, which all have rows, into the chains of the cells at `slots` (c,).

    runs: their members without the last, which is `changed`. held: the store's arrays.
    """
    (blocks, run_rows, cells, run_crossed), (rows, following, crossed, heads) = runs, held
    for run in range(len(run_rows)):
        row, cell = run_rows[run], cells[run]
        if changed[run]:
            rows[row], crossed[row] = blocks[run], run_crossed[run]
        if run == 0 or cells[run - 1] != cell:
            heads[slots[cell]] = row
        is_last = run + 1 == len(run_rows) or cells[run + 1] != cell
        following[row] = NO_BLOCK if is_last else run_rows[run + 1]


@compiled()
def _unlink_released(held, slots):
    """Let the chains of the cells at `slots` (c,) lead past rows without points; held: the store's arrays."""
    rows, following, _, heads = held
    for slot in slots:
        before, row = NO_BLOCK, heads[slot]
        while row != NO_BLOCK:
            after = following[row]
            if rows[row, COUNT] > 0.0:
                before = row
            elif before == NO_BLOCK:
                heads[slot] = after
            else:
                following[before] = after
            row = after


class RunningCopy:
    """The blocks as they were when it began.

    The map tells which rows it is about to change; those that are not copied yet are put aside as they are. A map that
    grows has other arrays from then on, and these stay as they are.
    """

    def __init__(self, rows: np.ndarray, crossed: np.ndarray, used: int, resolution: float) -> None:
        """`rows`, `crossed`: of the map, whose first `used` elements are copied. resolution: side of a cell, m."""
        self._rows, self._crossed, self._resolution = rows, crossed, resolution
        self._copy = np.empty((used, ROW_WIDTH)), np.empty(used, dtype=crossed.dtype)
        self._done = 0
        self._aside: List[Tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    @property
    def is_complete(self) -> bool:
        return self._done == len(self._copy[1])

    def before_change(self, rows: np.ndarray) -> None:
        """Learn that the map is about to change `rows` (n,)."""
        left = rows[(rows >= self._done) & (rows < len(self._copy[1]))]
        if len(left):
            self._aside.append((left, self._rows[left], self._crossed[left]))

    def step(self) -> None:
        """Copy the next piece; the map must not change meanwhile."""
        piece = slice(self._done, min(self._done + _PIECE, len(self._copy[1])))
        for copy, array in zip(self._copy, (self._rows, self._crossed)):
            copy[piece] = array[piece]
        self._done = piece.stop

    @property
    def blocks(self) -> Blocks:
        """All blocks, in no particular order, once the copy is complete."""
        rows, crossed = self._copy
        while self._aside:
            # What was put aside first is the oldest, and counts.
            places, before, before_crossed = self._aside.pop()
            rows[places], crossed[places] = before, before_crossed
        held = np.flatnonzero(rows[:, COUNT])
        if len(held) == len(rows):
            return Blocks(rows, self._resolution, crossed)
        return Blocks(rows[held], self._resolution, crossed[held])


def finished(copy: RunningCopy, lock: RLock) -> Blocks:
    """Complete a copy, holding the lock of its map for one piece at a time, and return the blocks."""
    while True:
        with lock:
            copy.step()
        if copy.is_complete:
            return copy.blocks
        time.sleep(_PAUSE)
