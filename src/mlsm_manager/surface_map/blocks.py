"""Blocks of a Multi Level Surface Map as arrays (thesis 6.2.1)."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol, Sequence

import numpy as np

from node_support.geometry import cells_of, keys_of

MEAN = slice(0, 4)
SQUARES = slice(4, 8)
COUNT = 8
BOTTOM = 9
TOP = 10
ROW_WIDTH = 11
MOST_CROSSINGS = np.iinfo(np.uint16).max  # crossings are counted up to here, in two bytes per block


class BlockType(IntEnum):
    """Kind of surface. FREE (thesis 6.2.1) is what the blocks of a map's free space are, see surface_map/free_space."""

    HORIZONTAL = 0
    VERTICAL = 1
    FREE = 2


@dataclass(frozen=True)
class Blocks:
    """A snapshot of a map's blocks, in the map's frame.

    rows: (n, 11) float64: mean x y z [m] and strength, their sums of squared deviations, number of points,
        bottom and top [m].
    resolution: side of a cell, m.
    crossed: (n,) uint16, number of beams that crossed the block since a point last fell into it.
    """

    rows: np.ndarray
    resolution: float
    crossed: np.ndarray

    @classmethod
    def uncrossed(cls, rows: np.ndarray, resolution: float) -> "Blocks":
        """Return blocks that no beam has crossed yet."""
        return cls(rows, resolution, np.zeros(len(rows), dtype=np.uint16))

    @classmethod
    def none(cls, resolution: float) -> "Blocks":
        return cls.uncrossed(np.empty((0, ROW_WIDTH)), resolution)

    @classmethod
    def joined(cls, parts: "Sequence[Blocks]") -> "Blocks":
        """Return the blocks of all `parts`, at least one, as they are: they may overlap."""
        rows, crossed = ([getattr(part, name) for part in parts] for name in ("rows", "crossed"))
        return cls(np.concatenate(rows), parts[0].resolution, np.concatenate(crossed))

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def mean(self) -> np.ndarray:
        """(n, 4) mean x y z [m] and strength."""
        return self.rows[:, MEAN]

    @property
    def variance(self) -> np.ndarray:
        """(n, 4) variance of x y z [m^2] and strength, of the population (equation 6.6 intends this one)."""
        return self.rows[:, SQUARES] / self.rows[:, COUNT, np.newaxis]

    @property
    def count(self) -> np.ndarray:
        """(n,) number of points."""
        return self.rows[:, COUNT].astype(np.int64)

    @property
    def bottom(self) -> np.ndarray:
        """(n,) z of the lowest point, m."""
        return self.rows[:, BOTTOM]

    @property
    def height(self) -> np.ndarray:
        """(n,) z of the highest point, m; the thesis calls it height."""
        return self.rows[:, TOP]

    @property
    def depth(self) -> np.ndarray:
        """(n,) from the lowest to the highest point, m."""
        return self.height - self.bottom

    @property
    def type(self) -> np.ndarray:
        """(n,) BlockType values; VERTICAL from a depth of one cell on, which does not depend on the order of points."""
        return np.where(self.depth >= self.resolution, BlockType.VERTICAL, BlockType.HORIZONTAL)

    @property
    def cells(self) -> np.ndarray:
        """(n, 2) int64 indices of each block's cell; cell i spans i to i + 1 times the resolution."""
        return cells_of(self.mean, self.resolution)

    @property
    def keys(self) -> np.ndarray:
        """(n,) int64, the key of each block's cell."""
        return keys_of(self.rows, self.resolution)

    @property
    def centers(self) -> np.ndarray:
        """(n, 2) x y of each block's cell centre, m."""
        return (self.cells + 0.5) * self.resolution

    @property
    def is_flat(self) -> bool:
        """Whether heights tell nothing: all points are within one cell's side in z, as where a sonar scans level."""
        return not len(self) or float(self.height.max() - self.bottom.min()) < self.resolution

    def gaps(self, others: "Blocks", rows: np.ndarray) -> np.ndarray:
        """Return the height (n,) [m] between each block and one of others, in `rows` (n,); up to 0 where they meet."""
        return np.maximum(self.bottom - others.height[rows], others.bottom[rows] - self.height)

    def take(self, chosen: np.ndarray) -> "Blocks":
        """Return the blocks at `chosen`, a mask (n,) or indices (k,)."""
        return Blocks(self.rows[chosen], self.resolution, self.crossed[chosen])

    def in_box(self, low: np.ndarray, high: np.ndarray) -> "Blocks":
        """Return the blocks with means from `low` to `high`, (2,) x y or (3,) x y z [m]."""
        places = self.rows[:, : len(low)]
        return self.take(((places >= low) & (places <= high)).all(axis=1))


class BlockSource(Protocol):
    """What gives the blocks in a box: a map, or a copy of its blocks."""

    def in_box(self, low: np.ndarray, high: np.ndarray) -> Blocks:
        """Return the blocks with means from `low` to `high`, (2,) x y or (3,) x y z [m]; infinite ends are allowed."""


def all_of(source: BlockSource) -> Blocks:
    return source.in_box(np.full(2, -np.inf), np.full(2, np.inf))
