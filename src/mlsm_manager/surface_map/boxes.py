"""Square tiles of a map's cells, with the boxes that show their blocks.

rviz draws a CUBE_LIST quickly but gives all its cubes one size. Two cubes of height h, one at the bottom and one at the
top of a block, cover every depth from h to 2 h exactly. So one list per tile and power of two shows all blocks as they
are.
"""

from dataclasses import dataclass
from typing import Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks, BlockType
from mlsm_manager.surface_map.mlsm import TILE_BITS
from node_support.geometry import cell_keys, cells_of_keys

THINNEST = -4  # power of two: a sixteenth of a cell is the thinnest box that still shows


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
