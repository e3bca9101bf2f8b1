"""Blocks made by hand, one per cell, and the boxes that show them, list by list."""

from typing import List, NamedTuple, Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks, BlockType
from mlsm_manager.surface_map.tiles import box_lists, box_size, box_type


def blocks_of(intervals, resolution=0.5):
    """Return one block for each (bottom, top), in cells (0, 0), (1, 0), (2, 0) and so on."""
    rows = np.zeros((len(intervals), 11))
    for index, (bottom, top) in enumerate(intervals):
        rows[index] = [(index + 0.3) * resolution, 0.2, (bottom + top) / 2, 40, 1, 2, 3, 4, 2, bottom, top]
    return Blocks(rows, resolution)


class BoxList(NamedTuple):
    """Boxes of one size in one tile: centers (n, 3) m, owners (n,) indices of the blocks that they show."""

    tile: Tuple[int, int]
    power: int
    type: BlockType
    size: np.ndarray
    centers: np.ndarray
    owners: np.ndarray


def boxes_by_list(blocks: Blocks) -> List[BoxList]:
    """Return the lists of boxes that show `blocks`."""
    lists, centers, owners = box_lists(blocks), [], []
    for start, end in zip(lists.starts, lists.starts[1:]):
        centers.append(lists.centers[start:end])
        owners.append(lists.owners[start:end])
    kinds = zip(map(tuple, lists.tiles.tolist()), lists.powers.tolist(), centers, owners)
    return [
        BoxList(tile, power, box_type(power), np.array(box_size(blocks.resolution, power)), *boxes)
        for tile, power, *boxes in kinds
    ]
