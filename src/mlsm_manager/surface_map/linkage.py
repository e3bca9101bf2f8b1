"""Decides which points and blocks of a cell belong together.

A point belongs to a block when it is closer than the resolution to its top or bottom, or between them, and a point that
belongs to several fuses them (thesis 6.5.6). In one cell that is single linkage in z: the partition that is left at
the end does not depend on the order in which the points came. So a whole scan is sorted once and split at its gaps.
"""

from dataclasses import dataclass
from typing import Tuple, TypeVar

import numpy as np

from mlsm_manager.surface_map.blocks import BOTTOM, COUNT, MEAN, SQUARES, TOP, Blocks
from mlsm_manager.surface_map.cell_order import cell_order

AnyExtents = TypeVar("AnyExtents", bound="Extents")


@dataclass(frozen=True)
class Extents:
    """Vertical intervals in cells: what decides which of them belong together.

    cell: (n,) int64 key of the cell. bottom, top: (n,) m. row: (n,) int64 number of the stored block, -1 for what is
    new.
    """

    cell: np.ndarray
    bottom: np.ndarray
    top: np.ndarray
    row: np.ndarray

    def __len__(self) -> int:
        return len(self.cell)

    def take(self: AnyExtents, index: np.ndarray) -> AnyExtents:
        """Return those at `index` (k,), in its order."""
        return type(self)(*(getattr(self, name)[index] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class Intervals(Extents):
    """Vertical intervals with the statistics of the points inside.

    count: (n,) points. mean, squares: (n, 4) mean of x y z strength and sum of squared deviations from it.
    crossed: (n,) uint16 number of beams that crossed it since a point last fell into it.
    """

    count: np.ndarray
    mean: np.ndarray
    squares: np.ndarray
    crossed: np.ndarray

    @property
    def extents(self) -> Extents:
        """The same without the statistics."""
        return Extents(self.cell, self.bottom, self.top, self.row)


def joined(first: AnyExtents, second: AnyExtents) -> AnyExtents:
    """Return those of the first, then those of the second."""
    names = first.__dataclass_fields__
    return type(first)(*(np.concatenate([getattr(first, name), getattr(second, name)]) for name in names))


def concatenated(first: AnyExtents, second: AnyExtents) -> AnyExtents:
    """Return both, sorted by cell, then by bottom."""
    both = joined(first, second)
    return both.take(cell_order(both.cell, both.bottom))


def intervals_of(blocks: Blocks, cell: np.ndarray) -> Intervals:
    """Return blocks (n) of cells with keys `cell` (n,) as intervals that are new, in the blocks' order."""
    rows = blocks.rows
    new = np.full(len(rows), -1, dtype=np.int64)
    return Intervals(
        cell, rows[:, BOTTOM], rows[:, TOP], new, rows[:, COUNT], rows[:, MEAN], rows[:, SQUARES], blocks.crossed
    )


def group_points(points: np.ndarray, cell: np.ndarray, resolution: float) -> Intervals:
    """Return the intervals that points (n, 4) of cells with keys `cell` (n,) make among themselves, n > 0."""
    order = cell_order(cell, points[:, 2])
    cell, points = cell[order], points[order]
    z = points[:, 2]
    is_start = np.empty(len(points), dtype=bool)
    is_start[0] = True
    is_start[1:] = (cell[1:] != cell[:-1]) | (z[1:] - z[:-1] >= resolution)
    starts = np.flatnonzero(is_start)
    ends = np.append(starts[1:], len(points)) - 1
    count = (ends - starts + 1).astype(np.float64)
    mean, squares = _statistics(points, starts, ends - starts + 1)
    new = np.full(len(starts), -1, dtype=np.int64)
    return Intervals(
        cell[starts], z[starts], z[ends], new, count, mean, squares, np.zeros(len(starts), dtype=np.uint16)
    )


def _statistics(points: np.ndarray, starts: np.ndarray, sizes: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return mean and sum of squared deviations, (g, 4) each, of points (n, 4) in groups from `starts` (g,) on."""
    mean, squares = points[starts], np.zeros((len(starts), points.shape[1]))
    several = sizes > 1
    if not several.any():
        return mean, squares
    points, sizes = points[np.repeat(several, sizes)], sizes[several]
    group = np.repeat(np.arange(len(sizes)), sizes)
    # From one of the points on: a plain sum rounds, and the mean of points on a border would leave their cell.
    first = mean[several]
    means = first + _sums(points - first[group], group, len(sizes)) / sizes[:, np.newaxis].astype(np.float64)
    mean[several], squares[several] = means, _sums((points - means[group]) ** 2, group, len(sizes))
    return mean, squares


def link(intervals: Extents, resolution: float) -> np.ndarray:
    """Return the positions, (m,), at which a new block starts in sorted `intervals` (n > 0).

    In one cell the stored blocks must lie at least the resolution apart from each other, and so must the new ones.
    """
    cell = intervals.cell
    reached = np.maximum(_last_top(intervals, intervals.row < 0), _last_top(intervals, intervals.row >= 0))
    starts = np.empty(len(intervals), dtype=bool)
    starts[0] = True
    starts[1:] = (cell[1:] != cell[:-1]) | (intervals.bottom[1:] - reached[:-1] >= resolution)
    return np.flatnonzero(starts)


def linked_alone(intervals: Intervals, resolution: float) -> Intervals:
    """Return what intervals in any order (n > 0) make among themselves, sorted, at least the resolution apart."""
    if not _is_sorted(intervals):
        intervals = intervals.take(cell_order(intervals.cell, intervals.bottom))
    while True:
        apart = intervals.bottom[1:] - intervals.top[:-1] >= resolution
        starts = np.flatnonzero(np.append(True, (intervals.cell[1:] != intervals.cell[:-1]) | apart))
        if len(starts) == len(intervals):
            return intervals
        # One pass joins neighbours only; what reaches beyond its neighbour meets the next one in the next pass.
        intervals = merge(intervals, starts)


def _is_sorted(intervals: Extents) -> bool:
    cell, bottom = intervals.cell, intervals.bottom
    return bool(((cell[1:] > cell[:-1]) | ((cell[1:] == cell[:-1]) & (bottom[1:] >= bottom[:-1]))).all())


def _last_top(intervals: Extents, chosen: np.ndarray) -> np.ndarray:
    """Return, for each interval, the top of the last chosen one up to it in its cell, -inf where there is none.

    The chosen ones lie apart from each other, so the last of them is the highest.
    """
    last = np.maximum.accumulate(np.where(chosen, np.arange(len(intervals)), -1))
    exists = (last >= 0) & (intervals.cell[last] == intervals.cell)
    return np.where(exists, intervals.top[last], -np.inf)


def merge(intervals: Intervals, starts: np.ndarray) -> Intervals:
    """Return one interval for each run that begins at `starts`, with exactly pooled mean and variance.

    The pooling is that of Chan, Golub and LeVeque (1979); equation 6.6 of the thesis underestimates the variance. Of
    the stored blocks in a run the one with the highest number gives its row. Whatever is new ends the count of
    crossings of what was stored, because a beam found the block where it was.
    """
    group = np.zeros(len(intervals), dtype=np.int64)
    group[starts[1:]] = 1
    group = np.cumsum(group)
    count = np.add.reduceat(intervals.count, starts)
    first = intervals.mean[starts]
    offsets = (intervals.mean - first[group]) * intervals.count[:, np.newaxis]
    mean = first + _sums(offsets, group, len(starts)) / count[:, np.newaxis]
    shift = intervals.mean - mean[group]
    squares = _sums(intervals.squares + shift**2 * intervals.count[:, np.newaxis], group, len(starts))
    return Intervals(
        intervals.cell[starts],
        intervals.bottom[starts],
        np.maximum.reduceat(intervals.top, starts),
        np.maximum.reduceat(intervals.row, starts),
        count,
        mean,
        squares,
        np.maximum.reduceat(np.where(intervals.row < 0, intervals.crossed, 0), starts),
    )


def _sums(values: np.ndarray, group: np.ndarray, groups: int) -> np.ndarray:
    return np.column_stack([np.bincount(group, weights=column, minlength=groups) for column in values.T])
