"""A smooth field over the map, high where echoes are expected: what a correlative search climbs (Olson 2009)."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from mlsm_manager.surface_map.blocks import Blocks

# Times the field's width: what is as dense over four widths is clutter.
_BROAD = 4.0


@dataclass(frozen=True)
class ScoreField:
    """Values on a grid. values: (ny, nx) float32 from 0 to 1. origin: (2,) m, corner of cell (0, 0). cell: side, m."""

    values: np.ndarray
    origin: np.ndarray
    cell: float

    @classmethod
    def of_blocks(cls, blocks: Blocks, cell: float, width: float, margin: float) -> "ScoreField":
        """Smooth the blocks with a Gaussian of standard deviation `width`; the grid reaches `margin` beyond them.

        What is as dense all around, as clutter is, is taken away: it would say "here" everywhere. One block that
        stands alone counts half as much as a dense wall.
        """
        centers = blocks.mean[:, :2]
        origin = np.floor((centers.min(axis=0) - margin) / cell) * cell
        shape = np.ceil((centers.max(axis=0) + margin - origin) / cell).astype(np.int64) + 1
        index = ((centers - origin) / cell).astype(np.int64)
        flat = index[:, 1] * shape[0] + index[:, 0]
        mass = np.bincount(flat, weights=np.sqrt(blocks.count), minlength=shape.prod()).reshape(shape[1], shape[0])
        mass = mass.astype(np.float32)
        peak = 2.0 * np.pi * (width / cell) ** 2
        near = gaussian_filter(mass, width / cell, mode="constant") * peak
        broad = gaussian_filter(mass, _BROAD * width / cell, mode="constant", truncate=2.0) * peak
        excess = np.maximum(near - broad, 0.0)
        return cls(excess / (1.0 + excess), origin, cell)

    def at(self, points: np.ndarray) -> np.ndarray:
        """Return the values at points (..., 2), 0 outside the grid."""
        index = self.index(points)
        rows, columns = self.values.shape
        x, y = index[..., 0], index[..., 1]
        inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
        return np.where(inside, self.values[np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)], 0.0)

    def index(self, points: np.ndarray) -> np.ndarray:
        """Return (..., 2) int64 column and row of the cells that hold points (..., 2)."""
        return np.floor((points - self.origin) / self.cell).astype(np.int64)

    def shifted_sums(self, points: np.ndarray, weights: np.ndarray, reach: int) -> np.ndarray:
        """Return (2 reach + 1, 2 reach + 1) weighted sums of the values at points (n, 2) shifted by whole cells.

        Entry [i, j] is for a shift by j - reach cells in x and i - reach cells in y.
        """
        index = self.index(points)
        rows, columns = self.values.shape
        x, y = index[:, 0], index[:, 1]
        near = (x >= reach) & (x < columns - reach) & (y >= reach) & (y < rows - reach)
        size = 2 * reach + 1
        patches = _windows(self.values, size)[y[near] - reach, x[near] - reach]
        return np.tensordot(weights[near].astype(np.float32), patches, axes=1)


def _windows(values: np.ndarray, size: int) -> np.ndarray:
    """Return a read-only view (rows - size + 1, columns - size + 1, size, size) of all square windows of `values`.

    numpy has this as sliding_window_view from 1.20 on.
    """
    rows, columns = values.shape
    shape = (max(rows - size + 1, 0), max(columns - size + 1, 0), size, size)
    return np.lib.stride_tricks.as_strided(values, shape, values.strides * 2, writeable=False)
