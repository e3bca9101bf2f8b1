"""Maps as rasters, one value a cell, their files, and surfaces as thin as they are known (Steger, TPAMI 1998)."""

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Tuple

import numpy as np
import yaml
from scipy.ndimage import gaussian_filter, label, maximum_filter

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.map_file import ExportError
from node_support.files import write_whole

UNKNOWN, FREE, OCCUPIED = -1, 0, 100
_MOST_CELLS = 400_000_000  # more would take gigabytes: one point far off, at 0.01 m, asks for that
_GREY = {FREE: 254, UNKNOWN: 205, OCCUPIED: 0}  # as map_server (trinary mode) takes them given `_THRESHOLDS`
_THRESHOLDS = {"negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.196}
_NO_DATA = -9999.0


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
    low_cell, shape = box_around(np.concatenate([blocks.cells for blocks in layers]))
    values = np.full(shape, UNKNOWN, dtype=np.int8)
    for blocks, value in zip(layers, (FREE, OCCUPIED)):
        values[tuple((blocks.cells - low_cell).T[::-1])] = value
    return Raster(values, low_cell * occupied.resolution, occupied.resolution)


def elevation(blocks: Blocks) -> Raster:
    """Return a float64 raster of the highest point in each cell, m, NaN where there is none.

    Raises ExportError for a raster that is too large.
    """
    low_cell, shape = box_around(blocks.cells)
    values = np.full(shape, -np.inf)
    np.maximum.at(values, tuple((blocks.cells - low_cell).T[::-1]), blocks.height)
    return Raster(np.where(np.isinf(values), np.nan, values), low_cell * blocks.resolution, blocks.resolution)


def box_around(cells: np.ndarray) -> Tuple[np.ndarray, Tuple[int, int]]:
    """Return the first cell (2,) int64 of the box around cells (n, 2), and its rows and columns."""
    if not len(cells):
        return np.zeros(2, dtype=np.int64), (0, 0)
    low, high = cells.min(axis=0), cells.max(axis=0)
    columns, rows = (int(width) for width in high - low + 1)
    if rows * columns > _MOST_CELLS:
        raise ExportError(f"{columns} x {rows} cells, must be at most {_MOST_CELLS}; crop the map first")
    return low, (rows, columns)


def write_map_server(path: Path, grid: Raster) -> None:
    """Write an occupancy raster as PATH.pgm and PATH.yaml, which map_server loads; raises OSError."""
    grey = np.full(grid.values.shape, _GREY[UNKNOWN], dtype=np.uint8)
    for value, shade in _GREY.items():
        grey[grid.values == value] = shade
    rows, columns = grey.shape
    write_whole(path, f"P5\n{columns} {rows}\n255\n".encode("ascii") + grey[::-1].tobytes())
    origin = [float(grid.origin[0]), float(grid.origin[1]), 0.0]
    words = {"image": path.name, "resolution": float(grid.resolution), "origin": origin, **_THRESHOLDS}
    write_whole(path.with_suffix(".yaml"), yaml.safe_dump(words, sort_keys=False).encode())


def write_ascii_grid(path: Path, raster: Raster) -> None:
    """Write a raster as an ESRI ASCII grid; NaN becomes its NODATA_value. Raises OSError."""
    rows, columns = raster.values.shape
    lines = [
        f"ncols {columns}",
        f"nrows {rows}",
        f"xllcorner {raster.origin[0]:.10g}",
        f"yllcorner {raster.origin[1]:.10g}",
        f"cellsize {raster.resolution:.10g}",
        f"NODATA_value {_NO_DATA:g}",
    ]
    text = BytesIO()
    np.savetxt(text, np.where(np.isnan(raster.values), _NO_DATA, raster.values)[::-1], fmt="%.4f")
    write_whole(path, "\n".join(lines).encode("ascii") + b"\n" + text.getvalue())


_SMOOTHING = 2.5  # cells: the echoes of one wall lie in a band of several
_SHARPNESS = 0.25  # of the smoothed number: a flat field of points has no ridge
_ROUND = 0.3  # of the bend across: what bends as much along is a heap, not a band
_FAINT, _NEAR = 0.35, 13  # of the most points within so many cells: at the rim of a heap noise makes rays
_REACH = 0.6  # cells from a cell's middle to the ridge that goes through it
_HALF = 0.6  # cells, of a line: neighbours touch
_FEWEST = 3  # cells in a chain of a ridge: fewer are no surface
_MOST_CELLS_OF_RIDGES = 16_000_000  # of the raster: with more, several cells are taken as one
_MARGIN = 4  # cells around the map, so that its rim is no edge


def ridges(blocks: Blocks) -> np.ndarray:
    """Return short lines (n, 2 ends, 2) m that run along the middle of each band of points, as seen from above.

    Points of all heights count. Where they form no band, there is no line.
    """
    if not len(blocks):
        return np.empty((0, 2, 2))
    numbers, low, side = counts(blocks)
    smooth = gaussian_filter(numbers, _SMOOTHING, mode="constant")
    slope_y, slope_x = np.gradient(smooth)
    (bend_yy, bend_xy), bend_xx = np.gradient(slope_y), np.gradient(slope_x, axis=1)
    spread = np.hypot((bend_xx - bend_yy) / 2.0, bend_xy)
    middle_bend = (bend_xx + bend_yy) / 2.0
    sharpest = middle_bend - spread
    # Across the ridge points the eigenvector of the sharpest bend.
    across = np.arctan2(2.0 * bend_xy, bend_xx - bend_yy) / 2.0 + np.pi / 2.0
    x, y = np.cos(across), np.sin(across)
    bent = np.minimum(sharpest, -np.finfo(np.float32).tiny)
    ahead = -(slope_x * x + slope_y * y) / bent
    is_ridge = (numbers > 0.0) & (-sharpest * _SMOOTHING**2 > _SHARPNESS * smooth)
    is_ridge &= smooth > _FAINT * maximum_filter(smooth, _NEAR)
    is_ridge &= middle_bend + spread > _ROUND * sharpest
    is_ridge &= np.maximum(np.abs(ahead * x), np.abs(ahead * y)) <= _REACH
    chains, _ = label(is_ridge, structure=np.ones((3, 3)))
    rows, columns = np.nonzero(is_ridge & (np.bincount(chains.ravel())[chains] >= _FEWEST))
    ahead, x, y = ahead[rows, columns], x[rows, columns], y[rows, columns]
    middle = np.column_stack([columns + 0.5 + ahead * x, rows + 0.5 + ahead * y])
    along = _HALF * np.column_stack([-y, x])
    return (np.stack([middle - along, middle + along], axis=1) + low) * side


def counts(blocks: Blocks) -> Tuple[np.ndarray, np.ndarray, float]:
    """Return the number of points in each cell (rows, columns) of a map with blocks, the lowest y first, with empty
    cells around; the lower left corner (2,) in cells; and the side of a cell, m.
    """
    cells = blocks.cells
    extent = np.prod(np.ptp(cells, axis=0).astype(np.float64) + 1.0)
    together = int(np.ceil(np.sqrt(max(extent / _MOST_CELLS_OF_RIDGES, 1.0))))
    cells = cells // together
    low = cells.min(axis=0) - _MARGIN
    columns, rows = cells.max(axis=0) + _MARGIN + 1 - low
    numbers = np.zeros((rows, columns), dtype=np.float32)
    np.add.at(numbers, tuple((cells - low).T[::-1]), blocks.count)
    return numbers, low, together * blocks.resolution
