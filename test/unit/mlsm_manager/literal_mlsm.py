"""The map as the thesis builds it, point by point (6.5.6): the oracle that the batch-wise map is compared with.

One departure: a block keeps its bottom instead of its depth, because height - depth rounds.
"""

import math

import numpy as np


class LiteralBlock:
    """One block, and the points that went into it."""

    def __init__(self, point):
        self.points = [point]
        self.n = 1
        self.mean = point.copy()
        self.variance = np.zeros(4)
        self.height = self.bottom = point[2]

    def holds(self, z, resolution):
        """Return whether a measurement at `z` belongs to this block."""
        return abs(z - self.height) < resolution or abs(self.bottom - z) < resolution or (self.bottom < z < self.height)

    def add_observation(self, point):
        """addObservationToBlock: equations 6.5 and 6.6."""
        n = self.n
        self.mean = n * self.mean / (n + 1) + point / (n + 1)
        self.variance = n * self.variance / (n + 1) + (point - self.mean) ** 2 / (n + 1)
        self.n = n + 1
        self._stretch(point[2], point[2])
        self.points.append(point)

    def fuse(self, other):
        """fuseBlocks: combine the means and variances of two blocks."""
        n = self.n + other.n
        between = self.n * other.n * (self.mean - other.mean) ** 2 / n**2
        self.variance = (self.n * self.variance + other.n * other.variance) / n + between
        self.mean = (self.n * self.mean + other.n * other.mean) / n
        self.n = n
        self._stretch(other.bottom, other.height)
        self.points += other.points

    def _stretch(self, bottom, height):
        self.bottom = min(self.bottom, bottom)
        self.height = max(self.height, height)


class LiteralMap:
    """Cells with lists of blocks."""

    def __init__(self, resolution):
        self.resolution = resolution
        self.cells = {}

    def insert(self, points):
        """Insert points (n, 4) one after the other."""
        for point in np.asarray(points, dtype=np.float64):
            cell = (math.floor(point[0] / self.resolution), math.floor(point[1] / self.resolution))
            self._insert(point, self.cells.setdefault(cell, []))

    def _insert(self, point, blocks):
        candidate = None
        for block in list(blocks):
            if not block.holds(point[2], self.resolution):
                continue
            if candidate is None:
                candidate = block
                candidate.add_observation(point)
            else:
                candidate.fuse(block)
                blocks.remove(block)
        if candidate is None:
            blocks.append(LiteralBlock(point))

    def sorted_blocks(self):
        """Return (cell, block) pairs, by cell, then by bottom."""
        pairs = [(cell, block) for cell, blocks in self.cells.items() for block in blocks]
        return sorted(pairs, key=lambda pair: (pair[0], pair[1].bottom))
