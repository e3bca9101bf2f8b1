"""The true extent of blocks as few lists of equal boxes, tile by tile.

rviz draws a CUBE_LIST quickly but gives all its cubes one size. Two cubes of height h, one at the bottom and one at the
top of a block, cover every depth from h to 2 h exactly. So one list per tile and power of two shows all blocks as they
are.
"""

from dataclasses import dataclass
from typing import List, Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks, BlockType
from mlsm_manager.surface_map.cell_index import cell_keys, cells_of_keys
from mlsm_manager.surface_map.changed_tiles import TILE_BITS

# Power of two: a sixteenth of a cell is the thinnest box that still shows.
THINNEST = -4


@dataclass(frozen=True)
class BoxList:
    """Boxes of one size in one tile.

    tile: its indices. power: the class of the boxes, their height is the resolution times two to this power.
    size: (3,) m. centers: (n, 3) m. owners: (n,) indices of the blocks that they show.
    """

    tile: Tuple[int, int]
    power: int
    size: np.ndarray
    centers: np.ndarray
    owners: np.ndarray

    @property
    def type(self) -> BlockType:
        """What they show: a block is VERTICAL from a depth of one cell on."""
        return BlockType.VERTICAL if self.power >= 0 else BlockType.HORIZONTAL


def box_lists(blocks: Blocks) -> List[BoxList]:
    """Return the boxes that cover every block from its bottom to its top across its cell, by tile, then by power.

    Box heights are powers of two times the resolution. Blocks thinner than 2 ** THINNEST cells are drawn that thick.
    """
    centers, power, owners = _boxes(blocks)
    tile = cell_keys(blocks.cells >> TILE_BITS)[owners]
    order = np.lexsort((power, tile))
    centers, power, owners, tile = centers[order], power[order], owners[order], tile[order]
    starts = np.flatnonzero((np.diff(tile, prepend=tile[:1] - 1) != 0) | (np.diff(power, prepend=power[:1]) != 0))
    ends = np.append(starts[1:], len(tile))
    side = blocks.resolution
    return [
        BoxList((x, y), level, np.array([side, side, side * 2.0**level]), centers[start:end], owners[start:end])
        for (x, y), level, start, end in zip(cells_of_keys(tile[starts]).tolist(), power[starts].tolist(), starts, ends)
    ]


def _boxes(blocks: Blocks) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return centers (m, 3) m, powers (m,) and blocks' indices (m,) of all boxes."""
    depth = np.maximum(blocks.depth, blocks.resolution * 2.0**THINNEST)
    # frexp finds the largest power of two that is not above the depth without a logarithm's rounding.
    power = np.maximum(np.frexp(depth / blocks.resolution)[1] - 1, THINNEST)
    offset = (depth - blocks.resolution * np.exp2(power)) / 2.0
    lower = np.column_stack([blocks.centers, (blocks.bottom + blocks.height) / 2.0 - offset])
    two = np.flatnonzero(offset > 0.0)
    upper = lower[two] + np.column_stack([np.zeros((len(two), 2)), 2.0 * offset[two]])
    owners = np.append(np.arange(len(blocks)), two)
    return np.concatenate([lower, upper]), power[owners], owners
