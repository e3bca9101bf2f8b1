"""Surfaces as thin as they are known: the ridges of the number of points (Steger, TPAMI 1998)."""

from typing import Tuple

import numpy as np
from scipy.ndimage import gaussian_filter, label, maximum_filter

from mlsm_manager.surface_map.blocks import Blocks

_SMOOTHING = 2.5  # cells: the echoes of one wall lie in a band of several
_SHARPNESS = 0.25  # of the smoothed number: a flat field of points has no ridge
_ROUND = 0.3  # of the bend across: what bends as much along is a heap, not a band
_FAINT, _NEAR = 0.35, 13  # of the most points within so many cells: at the rim of a heap noise makes rays
_REACH = 0.6  # cells from a cell's middle to the ridge that goes through it
_HALF = 0.6  # cells, of a line: neighbours touch
_FEWEST = 3  # cells in a row: fewer are no surface
_MOST_CELLS = 16_000_000  # of the raster: with more, several cells are taken as one
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
    rows, columns = np.nonzero(is_ridge & _in_rows(is_ridge))
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
    together = int(np.ceil(np.sqrt(max(extent / _MOST_CELLS, 1.0))))
    cells = cells // together
    low = cells.min(axis=0) - _MARGIN
    columns, rows = cells.max(axis=0) + _MARGIN + 1 - low
    numbers = np.zeros((rows, columns), dtype=np.float32)
    np.add.at(numbers, tuple((cells - low).T[::-1]), blocks.count)
    return numbers, low, together * blocks.resolution


def _in_rows(is_ridge: np.ndarray) -> np.ndarray:
    """Return which cells lie in a chain of enough cells of a ridge."""
    chains, _ = label(is_ridge, structure=np.ones((3, 3)))
    return np.bincount(chains.ravel())[chains] >= _FEWEST
