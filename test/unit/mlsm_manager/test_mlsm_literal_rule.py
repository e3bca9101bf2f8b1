"""The batch-wise map against the point-by-point rule of thesis 6.2 and 6.5.6.

Two departures from the thesis: a block keeps its bottom instead of its depth, because height - depth rounds, and the
variance of its points, of which equation 6.6 gives a part only.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_maps import in_order, map_with, partition

RESOLUTIONS = st.sampled_from([0.1, 0.25, 0.3, 0.5, 1.0])
BATCHES = st.integers(1, 6)
STRENGTH = st.integers(0, 127)


class LiteralBlock:
    """One block, and the points that went into it."""

    def __init__(self, point):
        self.points = [point]
        self.height = self.bottom = point[2]

    def holds(self, z, resolution):
        """Return whether a measurement at `z` belongs to this block."""
        return abs(z - self.height) < resolution or abs(self.bottom - z) < resolution or (self.bottom < z < self.height)

    def add_observation(self, point):
        """addObservationToBlock."""
        self.fuse(LiteralBlock(point))

    def fuse(self, other):
        """fuseBlocks."""
        self.bottom, self.height = min(self.bottom, other.bottom), max(self.height, other.height)
        self.points += other.points


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


def assert_follows_the_literal_rule(points, resolution, batches=1):
    """Compare a map built in batches with one built point by point."""
    points = np.asarray(points, dtype=np.float64).reshape(-1, 4)
    literal = LiteralMap(resolution)
    literal.insert(points)
    expected = literal.sorted_blocks()
    blocks = map_with(points, resolution, batches).blocks
    assert partition(blocks) == [
        (cell, block.bottom, block.height, len(block.points), int(block.height - block.bottom >= resolution))
        for cell, block in expected
    ]
    order = in_order(blocks)
    scale = max(np.abs(points).max(initial=1.0), 1.0)
    for row, (_, block) in zip(order, expected):
        inside = np.array(block.points)
        np.testing.assert_allclose(blocks.mean[row], inside.mean(axis=0), rtol=1e-12, atol=1e-12 * scale)
        np.testing.assert_allclose(blocks.variance[row], inside.var(axis=0), rtol=1e-9, atol=1e-13 * scale**2)


def _coordinates(values):
    return st.lists(st.tuples(values, values, values, STRENGTH), max_size=40)


def _on_lattice(points, spacing):
    return [(x * spacing, y * spacing, z * spacing, strength) for x, y, z, strength in points]


@given(_coordinates(st.floats(-1.5, 1.5)), st.sampled_from([-9000.0, 0.0, 9000.0]), RESOLUTIONS, BATCHES)
def test_random_points_at_the_origin_and_far_from_it(points, shift, resolution, batches):
    moved = [(x + shift, y - shift, z, strength) for x, y, z, strength in points]
    assert_follows_the_literal_rule(moved, resolution, batches)


@pytest.mark.parametrize("fraction", [1.0, 0.5, 1.0 / 3.0])
@given(_coordinates(st.integers(-3, 3)), RESOLUTIONS, BATCHES)
def test_lattices_whose_gaps_are_the_resolution_or_a_part_of_it(fraction, points, resolution, batches):
    assert_follows_the_literal_rule(_on_lattice(points, resolution * fraction), resolution, batches)


@given(st.lists(st.integers(-12, 12), max_size=60), RESOLUTIONS, BATCHES)
def test_one_crowded_column(levels, resolution, batches):
    points = [(0.0, 0.0, level * resolution * 0.5, index) for index, level in enumerate(levels)]
    assert_follows_the_literal_rule(points, resolution, batches)


@pytest.mark.parametrize("batches", [1, 7, 1000])
def test_a_scan_of_many_points(batches):
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.normal(0.0, 2.0, (1000, 2)), rng.normal(0.0, 4.0, 1000), rng.uniform(0, 127, 1000)])
    assert_follows_the_literal_rule(points, 0.5, batches)


@given(st.data(), _coordinates(st.integers(-2, 2)), RESOLUTIONS)
def test_the_order_of_the_points_changes_nothing(data, points, resolution):
    lattice = _on_lattice(points, resolution * 0.5)
    shuffled = data.draw(st.permutations(lattice))
    maps = [map_with(order, resolution, 3).blocks for order in (lattice, shuffled)]
    assert partition(maps[0]) == partition(maps[1])


@pytest.mark.parametrize(("gap", "counts"), [(0.5, [1, 1]), (np.nextafter(0.5, 0.0), [2])])
def test_a_gap_of_the_resolution_separates_and_a_little_less_does_not(gap, counts):
    assert map_with([[0, 0, 0.0, 1], [0, 0, gap, 1]]).blocks.count.tolist() == counts
