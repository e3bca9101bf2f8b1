"""Maps as rasters: one value for each cell of the box around them."""

from dataclasses import dataclass

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.export.errors import ExportError

UNKNOWN, FREE, OCCUPIED = -1, 0, 100
_MOST_CELLS = 400_000_000
"""A raster of more would take gigabytes: one point far off, at 0.01 m, asks for that; `map_tool crop` helps."""


@dataclass(frozen=True)
class Raster:
    """values: (rows, columns), the first row at the lowest y, the first column at the lowest x.

    origin: (2,) m, x y of the lower left corner of the first value's cell. resolution: side of a cell, m.
    """

    values: np.ndarray
    origin: np.ndarray
    resolution: float


def occupancy(occupied: Blocks, free: Blocks, low: float, high: float) -> Raster:
    """Return an int8 raster of what lies between the heights `low` and `high` [m]: UNKNOWN, FREE or OCCUPIED.

    Blocks count that reach into the slice with any part. Raises ExportError for a raster that is too large.
    """
    layers = [blocks.take((blocks.height >= low) & (blocks.bottom <= high)) for blocks in (free, occupied)]
    box = _Box.around(np.concatenate([blocks.cells for blocks in layers]))
    values = np.full(box.shape, UNKNOWN, dtype=np.int8)
    for blocks, value in zip(layers, (FREE, OCCUPIED)):
        values[box.places(blocks)] = value
    return Raster(values, box.low * occupied.resolution, occupied.resolution)


def elevation(blocks: Blocks) -> Raster:
    """Return a float64 raster of the highest point in each cell, m, NaN where there is none.

    Raises ExportError for a raster that is too large.
    """
    box = _Box.around(blocks.cells)
    values = np.full(box.shape, -np.inf)
    np.maximum.at(values, box.places(blocks), blocks.height)
    return Raster(np.where(np.isinf(values), np.nan, values), box.low * blocks.resolution, blocks.resolution)


@dataclass(frozen=True)
class _Box:
    """low: (2,) int64 the first cell. shape: rows and columns."""

    low: np.ndarray
    shape: tuple

    @staticmethod
    def around(cells: np.ndarray) -> "_Box":
        if not len(cells):
            return _Box(np.zeros(2, dtype=np.int64), (0, 0))
        low, high = cells.min(axis=0), cells.max(axis=0)
        columns, rows = (int(width) for width in high - low + 1)
        if rows * columns > _MOST_CELLS:
            raise ExportError(f"{columns} x {rows} cells, must be at most {_MOST_CELLS}; crop the map first")
        return _Box(low, (rows, columns))

    def places(self, blocks: Blocks) -> tuple:
        cells = blocks.cells - self.low
        return cells[:, 1], cells[:, 0]
