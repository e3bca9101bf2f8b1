"""Finds the first block of a cell on an unbounded grid."""

import numpy as np

from mlsm_manager.surface_map.large_array import LargeArray

NO_BLOCK = -1
EMPTY = np.iinfo(np.int64).min
SEGMENT_BITS = 12
"""A segment has 4096 places (48 kB): splitting one takes well below a millisecond."""
_PLACES = 1 << SEGMENT_BITS
LEAST_LOAD, LOAD_SPREAD = 0.58, 0.2
"""Share of a segment in use from which on it is split. The shares differ from segment to segment, because all fill at
the same rate and would otherwise be split at the same time."""
_MEAN_LOAD = 0.52
"""With so many expected cells in the mean no segment reaches the least share: that is 5 deviations away."""
GOLDEN_RATIO = 0.6180339887498949
# The golden ratio times 2^64, a prime of xxHash and one of splitmix64: they spread neighbouring cells over the table.
MULTIPLIER_X = np.uint64(0x9E3779B97F4A7C15)
MULTIPLIER_Y = np.uint64(0xC2B2AE3D27D4EB4F)
FINISHER = np.uint64(0xBF58476D1CE4E5B9)
_HALF = np.uint64(32)
LOCAL_SHIFT = np.uint64(64 - 32 - SEGMENT_BITS)


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
    """

    def __init__(self, expected_cells: int) -> None:
        self._bits = max(int(np.ceil(expected_cells / _MEAN_LOAD / _PLACES)) - 1, 0).bit_length()
        segments = 1 << self._bits
        self._directory = np.arange(segments)
        self._depth = np.full(segments, self._bits)
        self._used = np.zeros(segments, dtype=np.int64)
        self._keys = LargeArray(segments * _PLACES, (), np.int64)
        self._heads = LargeArray(segments * _PLACES, (), np.int32)
        self._clear(np.arange(segments))

    @property
    def nbytes(self) -> int:
        """Memory held, bytes."""
        return len(self._used) * _PLACES * (self._keys.values.itemsize + self.heads.itemsize)

    @property
    def heads(self) -> np.ndarray:
        """(s,) the number of the first block of the cell in each place, NO_BLOCK where there is none."""
        return self._heads.values

    def slots(self, keys: np.ndarray) -> np.ndarray:
        """Return (n,) int64 places in `heads`, making those that are new; keys is (n,) and holds none twice.

        Places are good until the next call.
        """
        self._make_room(keys)
        return self._placed(keys)

    def find(self, keys: np.ndarray) -> np.ndarray:
        """Return (n,) int32 `heads` of the cells with `keys` (n,), NO_BLOCK where there is none; makes none."""
        heads = np.full(keys.size, NO_BLOCK, dtype=np.int32)
        place = self._found(keys)
        known = place >= 0
        heads[known] = self.heads[place[known]]
        return heads

    def _found(self, keys: np.ndarray) -> np.ndarray:
        """Return (n,) the places of `keys` (n,), -1 of those that are not there."""
        places, held_keys = np.full(keys.size, -1), self._keys.values
        place, pending = self._first_places(keys), np.arange(keys.size)
        while pending.size:
            held = held_keys[place]
            found = held == keys[pending]
            places[pending[found]] = place[found]
            further = ~found & (held != EMPTY)
            pending, place = pending[further], _following(place[further])
        return places

    def _placed(self, keys: np.ndarray) -> np.ndarray:
        """Return (n,) the places of `keys` (n,); those that are new take one."""
        places, held_keys = self._first_places(keys), self._keys.values
        pending = np.arange(keys.size)
        while pending.size:
            place, wanted = places[pending], keys[pending]
            free = held_keys[place] == EMPTY
            held_keys[place[free]] = wanted[free]
            # Of several keys that claimed one free place the last has got it; the others look further.
            taken = place[free & (held_keys[place] == wanted)]
            self._used += np.bincount(taken >> SEGMENT_BITS, minlength=len(self._used))
            pending = pending[held_keys[place] != wanted]
            places[pending] = _following(places[pending])
        return places

    def _make_room(self, keys: np.ndarray) -> None:
        """Split segments until all `keys` (n,) have room."""
        segments = self._first_places(keys) >> SEGMENT_BITS
        full = self._full_with(segments)
        if not full.any():
            return
        new = keys[full[segments]]
        new = new[self._found(new) < 0]
        while True:
            full = self._full_with(self._first_places(new) >> SEGMENT_BITS)
            if not full.any():
                return
            self._split(np.flatnonzero(full))

    def _full_with(self, segments: np.ndarray) -> np.ndarray:
        """Return which segments (s,) are full with one more key in each of `segments` (n,)."""
        number = np.arange(len(self._used))
        load = LEAST_LOAD + LOAD_SPREAD * (number * GOLDEN_RATIO % 1.0)
        return self._used + np.bincount(segments, minlength=len(number)) > load * _PLACES

    def _split(self, segments: np.ndarray) -> None:
        """Give half of the range of hashes of each of `segments` (n,) to a new one, and the keys with it."""
        places = _places_of(segments)
        keys, heads = self._keys.values[places], self.heads[places]
        taken = keys != EMPTY
        new = len(self._used) + np.arange(len(segments))
        depth = self._depth[segments] + 1
        self._depth[segments] = depth
        self._depth, self._used = np.append(self._depth, depth), np.append(self._used, np.zeros_like(new))
        self._keys.reserve(len(self._used) * _PLACES)
        self._heads.reserve(len(self._used) * _PLACES)
        self._direct(segments, new)
        self._clear(np.append(segments, new))
        self.heads[self._placed(keys[taken])] = heads[taken]

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
        self._keys.values[places], self.heads[places] = EMPTY, NO_BLOCK
        self._used[segments] = 0

    def _first_places(self, keys: np.ndarray) -> np.ndarray:
        """Return (n,) the places at which the search for `keys` (n,) begins."""
        mixed = (keys >> 32).astype(np.uint64) * MULTIPLIER_X + (keys & 0xFFFFFFFF).astype(np.uint64) * MULTIPLIER_Y
        mixed = (mixed ^ (mixed >> _HALF)) * FINISHER
        # Two shifts: numpy does not define one by all 64 bits.
        entry = (mixed >> _HALF) >> np.uint64(32 - self._bits)
        local = (mixed >> LOCAL_SHIFT) & np.uint64(_PLACES - 1)
        return (self._directory[entry.astype(np.int64)] << SEGMENT_BITS) + local.astype(np.int64)


def _following(places: np.ndarray) -> np.ndarray:
    """Return the places (n,) that are looked at after `places` (n,): the next ones, around each segment."""
    return (places & ~(_PLACES - 1)) | ((places + 1) & (_PLACES - 1))


def _places_of(segments: np.ndarray) -> np.ndarray:
    """Return all places of segments (n,), (n * _PLACES,)."""
    return ((segments[:, np.newaxis] << SEGMENT_BITS) + np.arange(_PLACES)).ravel()
