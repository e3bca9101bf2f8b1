"""Boxes that show blocks, made in compiled loops; they are the same, in the same order. Needs numba."""

import math
from functools import lru_cache

import numpy as np
from numba import njit

from mlsm_manager.surface_map.block_shapes import THINNEST, BoxLists
from mlsm_manager.surface_map.blocks import BOTTOM, ROW_WIDTH, TOP, Blocks
from mlsm_manager.surface_map.changed_tiles import TILE_BITS

_POWERS = 64
"""Of depth, from THINNEST on: up to 2 ** 59 cells."""


def compiled_box_lists(blocks: Blocks) -> BoxLists:
    """Make boxes; see BoxMaker."""
    return BoxLists(*_box_lists(blocks.rows, blocks.resolution), blocks.resolution)


@lru_cache(maxsize=None)
def compile_loops() -> None:
    """Compile the loop, or read it from numba's cache, once in a process."""
    compiled_box_lists(Blocks(np.zeros((1, ROW_WIDTH)), 1.0))


@njit(cache=True)
def _box_lists(rows, resolution):
    """Return tiles (l, 2), powers (l,), starts (l + 1,), centers (n, 3) and owners (n,) of the boxes of b rows."""
    cells, powers, offsets = _shapes(rows, resolution)
    tile_of, tiles = _numbered_tiles(cells)
    sizes = np.zeros(len(tiles) * _POWERS + 1, np.int64)
    lists = tile_of * _POWERS + (powers - THINNEST)
    for block in range(len(rows)):
        sizes[lists[block] + 1] += 2 if offsets[block] > 0.0 else 1
    places = np.cumsum(sizes)
    held = np.flatnonzero(sizes[1:])
    starts = np.append(places[held], places[-1])
    centers, owners = np.empty((places[-1], 3)), np.empty(places[-1], np.int64)
    # In each list the lower boxes of all blocks come before the upper ones.
    for is_upper in (False, True):
        for block in range(len(rows)):
            if is_upper and not offsets[block] > 0.0:
                continue
            place = places[lists[block]]
            places[lists[block]] += 1
            centers[place, 0] = (cells[block, 0] + 0.5) * resolution
            centers[place, 1] = (cells[block, 1] + 0.5) * resolution
            lower = (rows[block, BOTTOM] + rows[block, TOP]) / 2.0 - offsets[block]
            centers[place, 2] = lower + 2.0 * offsets[block] if is_upper else lower
            owners[place] = block
    return tiles[held // _POWERS], held % _POWERS + THINNEST, starts, centers, owners


@njit(cache=True)
def _shapes(rows, resolution):
    """Return cells (b, 2), powers (b,) and half the distances between lower and upper boxes (b,) of b rows."""
    cells, powers, offsets = np.empty((len(rows), 2), np.int64), np.empty(len(rows), np.int64), np.empty(len(rows))
    thinnest = resolution * 2.0**THINNEST
    for block in range(len(rows)):
        cells[block, 0] = np.int64(np.floor(rows[block, 0] / resolution))
        cells[block, 1] = np.int64(np.floor(rows[block, 1] / resolution))
        depth = max(rows[block, TOP] - rows[block, BOTTOM], thinnest)
        powers[block] = max(np.int64(math.frexp(depth / resolution)[1]) - 1, THINNEST)
        offsets[block] = (depth - math.ldexp(resolution, powers[block])) / 2.0
    return cells, powers, offsets


@njit(cache=True)
def _numbered_tiles(cells):
    """Return the number of the tile of each of the cells (b, 2), (b,), and the tiles (t, 2), sorted by x, then y."""
    keys = np.empty(len(cells), np.int64)
    for cell in range(len(cells)):
        keys[cell] = ((cells[cell, 0] >> TILE_BITS) << 32) + (cells[cell, 1] >> TILE_BITS)
    # Neighbours in the store often share a tile: few changes are left to sort.
    changes = np.empty(len(keys), np.int64)
    many = 0
    for cell in range(len(keys)):
        if cell == 0 or keys[cell] != keys[cell - 1]:
            changes[many] = keys[cell]
            many += 1
    unique = np.unique(changes[:many])
    tiles = np.empty((len(unique), 2), np.int64)
    for tile in range(len(unique)):
        low = ((unique[tile] & 0xFFFFFFFF) ^ 0x80000000) - 0x80000000
        tiles[tile, 0], tiles[tile, 1] = (unique[tile] - low) >> 32, low
    numbers = np.empty(len(keys), np.int64)
    for cell in range(len(keys)):
        if cell and keys[cell] == keys[cell - 1]:
            numbers[cell] = numbers[cell - 1]
        else:
            numbers[cell] = np.searchsorted(unique, keys[cell])
    return numbers, tiles
