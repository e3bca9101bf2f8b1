"""Blocks made by hand, one per cell."""

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks


def blocks_of(intervals, resolution=0.5):
    """Return one block for each (bottom, top), in cells (0, 0), (1, 0), (2, 0) and so on."""
    rows = np.zeros((len(intervals), 11))
    for index, (bottom, top) in enumerate(intervals):
        rows[index] = [(index + 0.3) * resolution, 0.2, (bottom + top) / 2, 40, 1, 2, 3, 4, 2, bottom, top]
    return Blocks(rows, resolution)
