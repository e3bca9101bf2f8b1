"""The index of cells with its search in compiled loops; it finds and makes the same places. Needs numba."""

import numpy as np
from numba import njit

from mlsm_manager.surface_map.cell_index import (
    EMPTY,
    FINISHER,
    GOLDEN_RATIO,
    LEAST_LOAD,
    LOAD_SPREAD,
    LOCAL_SHIFT,
    MULTIPLIER_X,
    MULTIPLIER_Y,
    SEGMENT_BITS,
    CellIndex,
)

_PLACES = 1 << SEGMENT_BITS
_HALF = np.uint64(32)
_LOW, _LAST_PLACE = np.int64(0xFFFFFFFF), np.uint64(_PLACES - 1)


class CompiledCellIndex(CellIndex):
    """A CellIndex that looks for each key in one pass over the keys, unless segments must be split first."""

    def slots(self, keys: np.ndarray) -> np.ndarray:
        """Return (n,) int64 places in `heads`; see CellIndex."""
        if not _has_room(keys, self._directory, self._bits, self._used):
            self._make_room(keys)
        return _placed(keys, self._directory, self._bits, self._keys.values, self._used)

    def _found(self, keys: np.ndarray) -> np.ndarray:
        return _found(np.ascontiguousarray(keys), self._directory, self._bits, self._keys.values)


@njit(cache=True)
def _first_place(key, directory, bits):
    x, y = np.uint64(key >> 32), np.uint64(key & _LOW)
    mixed = x * MULTIPLIER_X + y * MULTIPLIER_Y
    mixed = (mixed ^ (mixed >> _HALF)) * FINISHER
    entry = (mixed >> _HALF) >> np.uint64(32 - bits)
    return (directory[np.int64(entry)] << SEGMENT_BITS) + np.int64((mixed >> LOCAL_SHIFT) & _LAST_PLACE)


@njit(cache=True)
def _has_room(keys, directory, bits, used):
    """Return whether all keys (n,) have room without a split, even if all are new."""
    more = np.zeros(len(used), np.int64)
    for number in range(len(keys)):
        more[_first_place(keys[number], directory, bits) >> SEGMENT_BITS] += 1
    for segment in range(len(used)):
        load = LEAST_LOAD + LOAD_SPREAD * (segment * GOLDEN_RATIO % 1.0)
        if used[segment] + more[segment] > load * _PLACES:
            return False
    return True


@njit(cache=True)
def _found(keys, directory, bits, held_keys):
    """Return (n,) the places of `keys` (n,), -1 of those that are not there."""
    places = np.empty(len(keys), np.int64)
    for number in range(len(keys)):
        key = keys[number]
        place = _first_place(key, directory, bits)
        while held_keys[place] != key and held_keys[place] != EMPTY:
            place = (place & ~(_PLACES - 1)) | ((place + 1) & (_PLACES - 1))
        places[number] = place if held_keys[place] == key else -1
    return places


@njit(cache=True)
def _placed(keys, directory, bits, held_keys, used):
    """Return (n,) the places of `keys` (n,); those that are new take one."""
    places = np.empty(len(keys), np.int64)
    for number in range(len(keys)):
        key = keys[number]
        place = _first_place(key, directory, bits)
        while held_keys[place] != key and held_keys[place] != EMPTY:
            place = (place & ~(_PLACES - 1)) | ((place + 1) & (_PLACES - 1))
        if held_keys[place] == EMPTY:
            held_keys[place] = key
            used[place >> SEGMENT_BITS] += 1
        places[number] = place
    return places
