"""Finds the first block of a cell on an unbounded grid; square tiles of cells, with the boxes that show their blocks.

rviz draws a CUBE_LIST quickly but gives all its cubes one size. Two cubes of height h, one at the bottom and one at the
top of a block, cover every depth from h to 2 h exactly. So one list per tile and power of two shows all blocks as they
are.
"""

from dataclasses import dataclass
from typing import Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks, BlockType
from node_support.numba_cache import compiled

NO_BLOCK = -1
_EMPTY = np.iinfo(np.int64).min
_FEWEST_PLACES = 1 << 10
_MOST_LOAD = 0.75  # share of the places in use from which on the table doubles: a search then takes some steps
# The golden ratio times 2^64, a prime of xxHash and one of splitmix64: they spread neighbouring cells over the table.
_MULTIPLIER_X = np.uint64(0x9E3779B97F4A7C15)
_MULTIPLIER_Y = np.uint64(0xC2B2AE3D27D4EB4F)
_FINISHER = np.uint64(0xBF58476D1CE4E5B9)
_HALF, _LOW = np.uint64(32), np.int64(0xFFFFFFFF)


def cell_keys(cells: np.ndarray) -> np.ndarray:
    """Return (n,) int64, one key per cell; cells is (n, 2) int64 with |index| < 2**31. Keys sort by x, then by y."""
    return (cells[:, 0] << 32) + cells[:, 1]


def cells_of_keys(keys: np.ndarray) -> np.ndarray:
    """Return the (n, 2) int64 cells whose keys `cell_keys` gave."""
    low = ((keys & 0xFFFFFFFF) ^ 0x80000000) - 0x80000000
    return np.column_stack([(keys - low) >> 32, low])


class CellIndex:
    """An open-addressing hash table from cell keys to block numbers.

    A hash and not tiles: walls cross a tile in a line and a far point needs one of its own, so that on real scans
    tiles spend more memory on empty cells than the blocks themselves take. Doubling takes some hundredths of a second
    at a million cells.

    heads: (s,) the number of the first block of the cell in each place, NO_BLOCK where there is none.
    """

    def __init__(self, expected_cells: int) -> None:
        self._begin(expected_cells)

    def _begin(self, cells: int) -> None:
        """Begin an empty table with room for so many cells, whose number of places is a power of two."""
        places = max(_FEWEST_PLACES, 1 << int(np.ceil(cells / _MOST_LOAD)).bit_length())
        self._keys, self.heads = np.full(places, _EMPTY), np.full(places, NO_BLOCK, dtype=np.int32)
        self._used = 0

    @property
    def nbytes(self) -> int:
        """Memory held, bytes."""
        return self._keys.nbytes + self.heads.nbytes

    def slots(self, keys: np.ndarray) -> np.ndarray:
        """Return (n,) int64 places in `heads`, making those that are new; keys is (n,) and holds none twice.

        Places are good until the next call.
        """
        most = _MOST_LOAD * len(self._keys)
        if self._used + len(keys) > most:
            cells = self._used + np.count_nonzero(_found(keys, self._keys) < 0)
            if cells > most:
                self._grow(cells)
        places, new = _placed(keys, self._keys)
        self._used += new
        return places

    def find(self, keys: np.ndarray) -> np.ndarray:
        """Return (n,) int32 `heads` of the cells with `keys` (n,), NO_BLOCK where there is none; makes none."""
        places = _found(np.ascontiguousarray(keys), self._keys)
        return np.where(places >= 0, self.heads[places], np.int32(NO_BLOCK))

    def _grow(self, cells: int) -> None:
        taken = self._keys != _EMPTY
        keys, heads = self._keys[taken], self.heads[taken]
        self._begin(cells)
        places, self._used = _placed(keys, self._keys)
        self.heads[places] = heads


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
def _found(keys, held_keys):
    """Return (n,) the places of `keys` (n,), -1 of those that are not there."""
    places = np.empty(len(keys), np.int64)
    for number in range(len(keys)):
        place = _searched(keys[number], held_keys)
        places[number] = place if held_keys[place] != _EMPTY else -1
    return places


@compiled()
def _placed(keys, held_keys):
    """Return (n,) the places of `keys` (n,), and how many of these are new and took one."""
    places, new = np.empty(len(keys), np.int64), 0
    for number in range(len(keys)):
        place = _searched(keys[number], held_keys)
        if held_keys[place] == _EMPTY:
            held_keys[place] = keys[number]
            new += 1
        places[number] = place
    return places, new


TILE_BITS = 4
"""A tile has 2 ** 4 = 16 cells on a side: 8 m at 0.5 m. Larger ones repeat more that did not change, smaller ones make
more markers than rviz draws fluidly."""
THINNEST = -4  # power of two: a sixteenth of a cell is the thinnest box that still shows
_MOST_PARTS = 64
"""So many insertions are noted before what they changed is put together; it bounds the memory of a map unasked."""


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


@dataclass(frozen=True)
class BoxLists:
    """Lists of boxes of one size in one tile, by tile, then by power.

    tiles: (l, 2) int64 indices. powers: (l,) int64 class of the boxes, whose height is the resolution times two to this
    power. starts: (l + 1,) where each list begins in centers (n, 3) m, and in owners (n,), the indices of the blocks
    that the boxes show. resolution: side of a cell, m.
    """

    tiles: np.ndarray
    powers: np.ndarray
    starts: np.ndarray
    centers: np.ndarray
    owners: np.ndarray
    resolution: float


def box_size(resolution: float, power: int) -> Tuple[float, float, float]:
    """Return width, length and height of the boxes of a class, m."""
    return resolution, resolution, resolution * 2.0**power


def box_type(power: int) -> BlockType:
    """Return what boxes of a class show: a block is VERTICAL from a depth of one cell on."""
    return BlockType.VERTICAL if power >= 0 else BlockType.HORIZONTAL


def box_lists(blocks: Blocks) -> BoxLists:
    """Return the boxes that cover every block from its bottom to its top across its cell.

    Blocks thinner than 2 ** THINNEST cells are drawn that thick.
    """
    centers, power, owners = _boxes(blocks)
    tile = cell_keys(blocks.cells >> TILE_BITS)[owners]
    order = np.lexsort((power, tile))
    power, tile = power[order], tile[order]
    is_start = np.append(True, (tile[1:] != tile[:-1]) | (power[1:] != power[:-1]))[: len(tile)]
    starts = np.flatnonzero(is_start)
    tiles, ends = cells_of_keys(tile[starts]), np.append(starts, len(tile))
    return BoxLists(tiles, power[starts], ends, centers[order], owners[order], blocks.resolution)


def _boxes(blocks: Blocks) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return centers (m, 3) m, powers (m,) and blocks' indices (m,) of all boxes."""
    depth = np.maximum(blocks.depth, blocks.resolution * 2.0**THINNEST)
    # frexp finds the largest power of two that is not above the depth without a logarithm's rounding.
    power = np.maximum(np.frexp(depth / blocks.resolution)[1].astype(np.int64) - 1, THINNEST)
    offset = (depth - blocks.resolution * np.exp2(power)) / 2.0
    lower = np.column_stack([blocks.centers, (blocks.bottom + blocks.height) / 2.0 - offset])
    two = np.flatnonzero(offset > 0.0)
    upper = lower[two] + np.column_stack([np.zeros((len(two), 2)), 2.0 * offset[two]])
    owners = np.append(np.arange(len(blocks)), two)
    return np.concatenate([lower, upper]), power[owners], owners
