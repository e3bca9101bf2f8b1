"""Finds the first block of a cell on an unbounded grid."""

import numpy as np

from mlsm_manager.surface_map.large_array import LargeArray
from node_support.numba_cache import compiled

NO_BLOCK = -1
_EMPTY = np.iinfo(np.int64).min
_SEGMENT_BITS = 12  # a segment has 4096 places (48 kB): splitting one takes well below a millisecond
_PLACES = 1 << _SEGMENT_BITS
_LEAST_LOAD, _LOAD_SPREAD = 0.58, 0.2
"""Share of a segment in use from which on it is split. The shares differ from segment to segment, because all fill at
the same rate and would otherwise be split at the same time."""
_MEAN_LOAD = 0.52
"""With so many expected cells in the mean no segment reaches the least share: that is 5 deviations away."""
_GOLDEN_RATIO = 0.6180339887498949
# The golden ratio times 2^64, a prime of xxHash and one of splitmix64: they spread neighbouring cells over the table.
_MULTIPLIER_X = np.uint64(0x9E3779B97F4A7C15)
_MULTIPLIER_Y = np.uint64(0xC2B2AE3D27D4EB4F)
_FINISHER = np.uint64(0xBF58476D1CE4E5B9)
_HALF, _LOW, _LAST_PLACE = np.uint64(32), np.int64(0xFFFFFFFF), np.uint64(_PLACES - 1)
_LOCAL_SHIFT = np.uint64(64 - 32 - _SEGMENT_BITS)


def cell_keys(cells: np.ndarray) -> np.ndarray:
    """Return (n,) int64, one key per cell; cells is (n, 2) int64 with |index| < 2**31. Keys sort by x, then by y."""
    return (cells[:, 0] << 32) + cells[:, 1]


def cells_of_keys(keys: np.ndarray) -> np.ndarray:
    """Return the (n, 2) int64 cells whose keys `cell_keys` gave."""
    low = ((keys & 0xFFFFFFFF) ^ 0x80000000) - 0x80000000
    return np.column_stack([(keys - low) >> 32, low])


class CellIndex:
    """An open-addressing hash table from cell keys to block numbers, which grows in pieces.

    The table is cut into segments, found through a directory by the first bits of a key's hash; one that is full is
    split in two (extendible hashing, Fagin et al. 1979), so that no insertion waits for the whole table to be moved.
    A hash and not tiles: walls cross a tile in a line and a far point needs one of its own, so that on real scans
    tiles spend more memory on empty cells than the blocks themselves take.

    heads: its values (s,) are the number of the first block of the cell in each place, NO_BLOCK where there is none.
    """

    def __init__(self, expected_cells: int) -> None:
        self._bits = max(int(np.ceil(expected_cells / _MEAN_LOAD / _PLACES)) - 1, 0).bit_length()
        segments = 1 << self._bits
        self._directory = np.arange(segments)
        self._depth = np.full(segments, self._bits)
        self._used = np.zeros(segments, dtype=np.int64)
        self._keys = LargeArray(segments * _PLACES, (), np.int64)
        self.heads = LargeArray(segments * _PLACES, (), np.int32)
        self._clear(np.arange(segments))

    @property
    def nbytes(self) -> int:
        """Memory held, bytes."""
        return len(self._used) * _PLACES * (self._keys.values.itemsize + self.heads.values.itemsize)

    def slots(self, keys: np.ndarray) -> np.ndarray:
        """Return (n,) int64 places in `heads`, making those that are new; keys is (n,) and holds none twice.

        Places are good until the next call.
        """
        if len(self._full_with(keys)):
            new = keys[self._found(keys) < 0]
            full = self._full_with(new)
            while len(full):
                self._split(full)
                full = self._full_with(new)
        return self._placed(keys)

    def find(self, keys: np.ndarray) -> np.ndarray:
        """Return (n,) int32 `heads` of the cells with `keys` (n,), NO_BLOCK where there is none; makes none."""
        places = self._found(keys)
        return np.where(places >= 0, self.heads.values[places], np.int32(NO_BLOCK))

    def _found(self, keys: np.ndarray) -> np.ndarray:
        return _found(np.ascontiguousarray(keys), self._directory, self._bits, self._keys.values)

    def _placed(self, keys: np.ndarray) -> np.ndarray:
        return _placed(keys, self._directory, self._bits, self._keys.values, self._used)

    def _full_with(self, keys: np.ndarray) -> np.ndarray:
        return _full_segments(keys, self._directory, self._bits, self._used)

    def _split(self, segments: np.ndarray) -> None:
        """Give half of the range of hashes of each of `segments` (n,) to a new one, and the keys with it."""
        places = _places_of(segments)
        keys, heads = self._keys.values[places], self.heads.values[places]
        taken = keys != _EMPTY
        new = len(self._used) + np.arange(len(segments))
        depth = self._depth[segments] + 1
        self._depth[segments] = depth
        self._depth, self._used = np.append(self._depth, depth), np.append(self._used, np.zeros_like(new))
        self._keys.reserve(len(self._used) * _PLACES)
        self.heads.reserve(len(self._used) * _PLACES)
        self._direct(segments, new)
        self._clear(np.append(segments, new))
        self.heads.values[self._placed(keys[taken])] = heads[taken]

    def _direct(self, old: np.ndarray, new: np.ndarray) -> None:
        """Let the directory lead to segments `new` (n,) with the second half of what led to `old` (n,)."""
        longer = int(self._depth.max()) - self._bits
        self._directory, self._bits = np.repeat(self._directory, 1 << longer), self._bits + longer
        successor = np.full(len(self._used), -1)
        successor[old] = new
        owner = self._directory
        second = (np.arange(len(owner)) >> (self._bits - self._depth[owner])) & 1 == 1
        self._directory = np.where(second & (successor[owner] >= 0), successor[owner], owner)

    def _clear(self, segments: np.ndarray) -> None:
        places = _places_of(segments)
        self._keys.values[places], self.heads.values[places] = _EMPTY, NO_BLOCK
        self._used[segments] = 0


def _places_of(segments: np.ndarray) -> np.ndarray:
    """Return all places of segments (n,), (n * _PLACES,)."""
    return ((segments[:, np.newaxis] << _SEGMENT_BITS) + np.arange(_PLACES)).ravel()


@compiled()
def _first_place(key, directory, bits):
    """Return the place at which the search for a key begins."""
    x, y = np.uint64(key >> 32), np.uint64(key & _LOW)
    mixed = x * _MULTIPLIER_X + y * _MULTIPLIER_Y
    mixed = (mixed ^ (mixed >> _HALF)) * _FINISHER
    # Two shifts: one by all 64 bits is not defined.
    entry = (mixed >> _HALF) >> np.uint64(32 - bits)
    return (directory[np.int64(entry)] << _SEGMENT_BITS) + np.int64((mixed >> _LOCAL_SHIFT) & _LAST_PLACE)


@compiled()
def _searched(key, directory, bits, held_keys):
    """Return the place that holds a key, or else the free one that it may take: places are searched in a ring."""
    place = _first_place(key, directory, bits)
    while held_keys[place] != key and held_keys[place] != _EMPTY:
        place = (place & ~(_PLACES - 1)) | ((place + 1) & (_PLACES - 1))
    return place


@compiled()
def _found(keys, directory, bits, held_keys):
    """Return (n,) the places of `keys` (n,), -1 of those that are not there."""
    places = np.empty(len(keys), np.int64)
    for number in range(len(keys)):
        place = _searched(keys[number], directory, bits, held_keys)
        places[number] = place if held_keys[place] != _EMPTY else -1
    return places


@compiled()
def _placed(keys, directory, bits, held_keys, used):
    """Return (n,) the places of `keys` (n,); those that are new take one."""
    places = np.empty(len(keys), np.int64)
    for number in range(len(keys)):
        place = _searched(keys[number], directory, bits, held_keys)
        if held_keys[place] == _EMPTY:
            held_keys[place] = keys[number]
            used[place >> _SEGMENT_BITS] += 1
        places[number] = place
    return places


@compiled()
def _full_segments(keys, directory, bits, used):
    """Return the segments (k,) that would be full if all `keys` (n,) were new."""
    more = np.zeros(len(used), np.int64)
    for number in range(len(keys)):
        more[_first_place(keys[number], directory, bits) >> _SEGMENT_BITS] += 1
    full, count = np.empty(len(used), np.int64), 0
    for segment in range(len(used)):
        load = _LEAST_LOAD + _LOAD_SPREAD * (segment * _GOLDEN_RATIO % 1.0)
        full[count] = segment
        count += used[segment] + more[segment] > load * _PLACES
    return full[:count]
