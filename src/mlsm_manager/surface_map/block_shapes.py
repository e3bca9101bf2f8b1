"""The true extent of blocks as few lists of equal boxes.

rviz draws a CUBE_LIST quickly but gives all its cubes one size. Two cubes of height h, one at the bottom and one at the
top of a block, cover every depth from h to 2 h exactly. So one list per power of two shows all blocks as they are.
"""

from dataclasses import dataclass
from typing import List

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks, BlockType

# Power of two: a sixteenth of a cell is the thinnest box that still shows.
THINNEST = -4


@dataclass(frozen=True)
class BoxList:
    """Boxes of one size: centers (n, 3) [m], size (3,) [m], what they show, and their class (its power of two)."""

    centers: np.ndarray
    size: np.ndarray
    type: BlockType
    power: int


def box_lists(blocks: Blocks) -> List[BoxList]:
    """Return the boxes that cover every block from its bottom to its top across its cell.

    Box heights are powers of two times the resolution, so VERTICAL blocks have powers from 0 on. Blocks thinner than
    2 ** THINNEST cells are drawn that thick.
    """
    thinnest = blocks.resolution * 2.0**THINNEST
    depth = np.maximum(blocks.depth, thinnest)
    # frexp finds the largest power of two that is not above the depth without a logarithm's rounding.
    power = np.maximum(np.frexp(depth / blocks.resolution)[1] - 1, THINNEST)
    height = blocks.resolution * np.exp2(power)
    middle = (blocks.bottom + blocks.height) / 2.0
    offset = (depth - height) / 2.0
    lower = np.column_stack([blocks.centers, middle - offset])
    upper = np.column_stack([lower[:, :2], middle + offset])
    needs_two = offset > 0.0
    return [
        _box_list(np.concatenate([lower[power == value], upper[(power == value) & needs_two]]), blocks, int(value))
        for value in np.unique(power)
    ]


def _box_list(centers: np.ndarray, blocks: Blocks, power: int) -> BoxList:
    size = np.array([blocks.resolution, blocks.resolution, blocks.resolution * 2.0**power])
    return BoxList(centers, size, BlockType.VERTICAL if power >= 0 else BlockType.HORIZONTAL, power)
