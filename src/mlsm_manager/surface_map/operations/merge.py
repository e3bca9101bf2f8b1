"""Two maps made one."""

from dataclasses import replace

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.files.map_file import StoredMap
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from mlsm_manager.surface_map.operations.move import LevelTransform, moved


def merged_blocks(first: Blocks, second: Blocks, T_first_second: LevelTransform) -> Blocks:
    """Return the blocks of both in the frame of the first. Raises ValueError when their resolutions differ.

    Where the transform keeps cells (see LevelTransform) this is the map that all points together make: number of
    points, mean, variance, bottom and top of each block. Where it does not, each block of the second goes whole into
    the cell of its mean. Number, mean and variance of all points together stay exact, bottom and top of all too; a
    point on the rim of its block can then count for a cell that lies up to one cell beside its own.
    """
    surface_map = MultiLevelSurfaceMap(first.resolution, limit=np.inf, expected_blocks=len(first) + len(second))
    surface_map.insert_blocks(first)
    surface_map.insert_blocks(moved(second, T_first_second))
    return surface_map.blocks


def merged(first: StoredMap, second: StoredMap, T_first_second: LevelTransform) -> StoredMap:
    """Return both maps as one, layer by layer, with frame, calibration and arrays of the first.

    Raises ValueError when the resolutions of a layer differ.
    """
    layers = dict(first.layers)
    for layer, blocks in second.layers.items():
        if layer in layers:
            layers[layer] = merged_blocks(layers[layer], blocks, T_first_second)
        else:
            layers[layer] = moved(blocks, T_first_second)
    return replace(first, layers=layers)
