"""Finds the first block of a cell on an unbounded grid."""

import numpy as np

_EMPTY = np.iinfo(np.int64).min
# Share of the table in use: from there on probing takes longer than growing.
_MAX_LOAD = 0.6
# The golden ratio times 2^64 and a prime of xxHash: they spread neighbouring cells over the table.
_MULTIPLIER_X = np.uint64(0x9E3779B97F4A7C15)
_MULTIPLIER_Y = np.uint64(0xC2B2AE3D27D4EB4F)
NO_BLOCK = -1


def cell_keys(cells: np.ndarray) -> np.ndarray:
    """Return (n,) int64, one key per cell; cells is (n, 2) int64 with |index| < 2**31. Keys sort by x, then by y."""
    return (cells[:, 0] << 32) + cells[:, 1]


def cells_of_keys(keys: np.ndarray) -> np.ndarray:
    """Return the (n, 2) int64 cells whose keys `cell_keys` gave."""
    low = ((keys & 0xFFFFFFFF) ^ 0x80000000) - 0x80000000
    return np.column_stack([(keys - low) >> 32, low])


class CellIndex:
    """An open-addressing hash table from cell keys to block numbers, in two numpy arrays.

    A hash and not tiles: walls cross a tile in a line and a far point needs one of its own, so that on real scans
    tiles spend more memory on empty cells than the blocks themselves take.
    """

    def __init__(self, expected_cells: int) -> None:
        self._count = 0
        self._allocate(int(expected_cells / _MAX_LOAD))

    @property
    def nbytes(self) -> int:
        """Memory held, bytes."""
        return self._keys.nbytes + self.heads.nbytes

    def slots(self, keys: np.ndarray) -> np.ndarray:
        """Return (n,) int64 places in `heads`, making those that are new; keys is (n,) and holds none twice."""
        if (self._count + keys.size) > _MAX_LOAD * self._keys.size:
            self._grow(self._count + keys.size)
        slots = self._first_slots(keys)
        pending = np.arange(keys.size)
        while pending.size:
            place, wanted = slots[pending], keys[pending]
            free = self._keys[place] == _EMPTY
            self._keys[place[free]] = wanted[free]
            # Of several keys that claimed one free place the last has got it; the others look further.
            self._count += int(np.count_nonzero(free & (self._keys[place] == wanted)))
            pending = pending[self._keys[place] != wanted]
            slots[pending] = (slots[pending] + 1) & (self._keys.size - 1)
        return slots

    def find(self, keys: np.ndarray) -> np.ndarray:
        """Return (n,) int32 `heads` of the cells with `keys` (n,), NO_BLOCK where there is none; makes none."""
        heads = np.full(keys.size, NO_BLOCK, dtype=np.int32)
        slots, pending = self._first_slots(keys), np.arange(keys.size)
        while pending.size:
            held = self._keys[slots]
            found = held == keys[pending]
            heads[pending[found]] = self.heads[slots[found]]
            further = ~found & (held != _EMPTY)
            pending, slots = pending[further], (slots[further] + 1) & (self._keys.size - 1)
        return heads

    def _allocate(self, minimum: int) -> None:
        capacity = 1 << max(int(minimum - 1).bit_length(), 10)
        self._keys = np.full(capacity, _EMPTY, dtype=np.int64)
        self.heads = np.full(capacity, NO_BLOCK, dtype=np.int32)
        self._shift = np.uint64(64 - (capacity.bit_length() - 1))

    def _grow(self, cells: int) -> None:
        taken = self._keys != _EMPTY
        keys, heads = self._keys[taken], self.heads[taken]
        self._allocate(int(cells / _MAX_LOAD) + 1)
        self._count = 0
        self.heads[self.slots(keys)] = heads

    def _first_slots(self, keys: np.ndarray) -> np.ndarray:
        mixed = (keys >> 32).astype(np.uint64) * _MULTIPLIER_X + (keys & 0xFFFFFFFF).astype(np.uint64) * _MULTIPLIER_Y
        return (mixed >> self._shift).astype(np.int64)
