"""Finds the basins in which a fine match may start: every pose of a window is scored against a field (Olson 2009)."""

from dataclasses import dataclass
from typing import List

import numpy as np
from scipy.ndimage import gaussian_filter

from mlsm_manager.scan_matching.scan_path import POSE, POSITION, RATE_YAW, YAW, PlanarMotion
from mlsm_manager.surface_map.blocks import Blocks
from node_support.geometry import rotated, wrapped

YAW_STEP = np.radians(2.75)  # rad: a point 20 m away moves by two search cells of 0.5 m
_BROAD = 4.0  # times the field's width: what is as dense over four widths is clutter
_MOST_POINTS = 160  # a scan has about 150 echoes; a dense one is thinned, so that it takes no longer
_APART, _APART_YAW = 2.0, np.radians(8.0)  # m and rad: nearer candidates end in the same fit


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

    def shifted_means(self, points: np.ndarray, reach: int) -> np.ndarray:
        """Return (2 reach + 1, 2 reach + 1) means of the values at points (n, 2), n > 0, shifted by whole cells.

        Entry [i, j] is for a shift by j - reach cells in x and i - reach cells in y.
        """
        x, y = np.floor((points - self.origin) / self.cell).astype(np.int64).T
        rows, columns = self.values.shape
        near = (x >= reach) & (x < columns - reach) & (y >= reach) & (y < rows - reach)
        patches = _windows(self.values, 2 * reach + 1)[y[near] - reach, x[near] - reach]
        return np.tensordot(np.full(len(patches), 1.0 / len(points), dtype=np.float32), patches, axes=1)


def _windows(values: np.ndarray, size: int) -> np.ndarray:
    """Return a read-only view (rows - size + 1, columns - size + 1, size, size) of all square windows of `values`.

    numpy has this as sliding_window_view from 1.20 on.
    """
    rows, columns = values.shape
    shape = (max(rows - size + 1, 0), max(columns - size + 1, 0), size, size)
    return np.lib.stride_tricks.as_strided(values, shape, values.strides * 2, writeable=False)


@dataclass(frozen=True)
class SearchWindow:
    """distance: m to either side in x and y. angle: rad to either side. yaw_rates: (k,) errors of that rate, rad/s."""

    distance: float
    angle: float
    yaw_rates: np.ndarray


def search(
    motion: PlanarMotion, field: ScoreField, center: np.ndarray, window: SearchWindow, penalty: np.ndarray, count: int
) -> List[np.ndarray]:
    """Return up to `count` states (8,) as in scan_path, the best first, none of them near a better one.

    center: (8,) state in the middle of the window. penalty: (3, 3) matrix A; a pose that lies d = (x, y, yaw) from the
    center loses d^T A d of its score.
    """
    points = len(motion.local)
    chosen = np.unique(np.linspace(0, points - 1, min(points, _MOST_POINTS)).astype(np.int64))
    reach = int(np.ceil(window.distance / field.cell))
    steps = int(np.ceil(window.angle / YAW_STEP))
    yaws = np.arange(-steps, steps + 1) * YAW_STEP
    offsets = np.arange(-reach, reach + 1) * field.cell
    apart = np.stack(np.meshgrid(yaws, offsets, offsets, indexing="ij")[::-1], axis=-1)  # x, y, yaw
    prior_cost = np.einsum("...a,ab,...b->...", apart, penalty, apart).astype(np.float32)
    scores = np.empty((len(window.yaw_rates), len(yaws), len(offsets), len(offsets)), dtype=np.float32)
    for number, rate in enumerate(window.yaw_rates):
        theta = center.copy()
        theta[RATE_YAW] += rate
        arms = motion.points(motion.path(theta))[chosen] - center[POSITION]
        for index, yaw in enumerate(yaws):
            points = center[POSITION] + rotated(arms, yaw)
            scores[number, index] = field.shifted_means(points, reach) - prior_cost[index]
    return _peaks(scores, center, window.yaw_rates, yaws, offsets, count)


def _peaks(
    scores: np.ndarray, center: np.ndarray, rates: np.ndarray, yaws: np.ndarray, offsets: np.ndarray, count: int
) -> List[np.ndarray]:
    best_rate = scores.argmax(axis=0)
    best = np.take_along_axis(scores, best_rate[np.newaxis], axis=0)[0]
    found: List[np.ndarray] = []
    while len(found) < count:
        index = np.unravel_index(int(best.argmax()), best.shape)
        if not np.isfinite(best[index]):
            break
        theta = center.copy()
        theta[POSE] += offsets[index[2]], offsets[index[1]], yaws[index[0]]
        theta[RATE_YAW] += rates[best_rate[index]]
        found.append(theta)
        near = [np.abs(yaws - yaws[index[0]]) < _APART_YAW]
        near += [np.abs(offsets - offsets[axis_index]) < _APART for axis_index in index[1:]]
        best[np.ix_(*near)] = -np.inf
    return found


def separation(first: np.ndarray, second: np.ndarray) -> float:
    """Return how far apart two states (8,) are: 1 where they differ by what keeps two candidates apart."""
    distance = np.hypot(*(first[POSITION] - second[POSITION])) / _APART
    return float(max(distance, abs(float(wrapped(first[YAW] - second[YAW]))) / _APART_YAW))
