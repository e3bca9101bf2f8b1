"""The map in square tiles of cells: which of them changed, and the boxes that show the blocks of each.

rviz draws a CUBE_LIST quickly but gives all its cubes one size. Two cubes of height h, one at the bottom and one at the
top of a block, cover every depth from h to 2 h exactly. So one list per tile and power of two shows all blocks as they
are.
"""

from dataclasses import dataclass
from typing import Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks, BlockType
from mlsm_manager.surface_map.cell_index import cell_keys, cells_of_keys

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
