"""Building the map both ways and comparing what came out."""

import numpy as np
from literal_mlsm import LiteralMap

from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap


def batch_map(points, resolution, batches=1):
    """Return the blocks of a map into which `points` went in so many batches."""
    mlsm = MultiLevelSurfaceMap(resolution)
    for batch in np.array_split(points, batches):
        mlsm.insert(batch)
    return mlsm.blocks


def partition(blocks):
    """Return what tells one partition of points from another: cell, bottom, top, n and kind of every block, sorted."""
    rows = zip(blocks.cells.tolist(), blocks.bottom, blocks.height, blocks.count, blocks.type)
    return sorted((tuple(cell), bottom, height, n, kind) for cell, bottom, height, n, kind in rows)


def in_order(blocks):
    """Return the order of blocks by cell, then by bottom."""
    return np.lexsort((blocks.bottom, blocks.cells[:, 1], blocks.cells[:, 0]))


def assert_follows_the_literal_rule(points, resolution, batches=1):
    """Compare a map built in batches with one built point by point."""
    points = np.asarray(points, dtype=np.float64).reshape(-1, 4)
    literal = LiteralMap(resolution)
    literal.insert(points)
    expected = literal.sorted_blocks()
    blocks = batch_map(points, resolution, batches)
    assert partition(blocks) == [
        (cell, block.bottom, block.height, block.n, int(block.height - block.bottom >= resolution))
        for cell, block in expected
    ]
    order = in_order(blocks)
    scale = max(np.abs(points).max(initial=1.0), 1.0)
    for row, (_, block) in zip(order, expected):
        inside = np.array(block.points)
        np.testing.assert_allclose(blocks.mean[row], block.mean, rtol=1e-12, atol=1e-12 * scale)
        np.testing.assert_allclose(blocks.variance[row], inside.var(axis=0), rtol=1e-9, atol=1e-13 * scale**2)
