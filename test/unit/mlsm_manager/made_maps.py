"""Maps made at random, and what tells two of them apart."""

import numpy as np

from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.map_file import Layer, StoredMap
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap


def random_points(seed, count, extent=10.0):
    """Return points (count, 4) in a cube of side 2 `extent`."""
    rng = np.random.RandomState(seed)
    return np.column_stack([rng.uniform(-extent, extent, (count, 3)), rng.uniform(0, 127, count)])


def map_with(points, resolution=0.5, batches=1, **options):
    """Return a map into which points (n, 4) went in so many batches."""
    surface_map = MultiLevelSurfaceMap(resolution, **options)
    for batch in np.array_split(np.asarray(points, dtype=np.float64).reshape(-1, 4), batches):
        surface_map.insert(batch)
    return surface_map


def random_map(seed=0, count=2000, resolution=0.5, extent=10.0):
    """Return a map of random points."""
    return map_with(random_points(seed, count, extent), resolution)


def stored_map(seed=0, **options):
    """Return all that a file can hold."""
    shown = random_map(seed, **options).blocks
    free = random_map(seed + 1, count=100).blocks
    arrays = {"place": np.array([1.0, 2.0, 0.3])}
    calibration = {"range_scale": 0.98, "sonar_delay": 0.1, "mode": "PEAKS"}
    return StoredMap("map", {Layer.SHOWN: shown, Layer.FREE: free}, calibration, 1.5e9, arrays)


def content(stored):
    """Return all that a stored map holds as something that can be compared."""
    layers = {
        layer.value: (blocks.rows.tobytes(), blocks.crossed.tobytes(), blocks.resolution)
        for layer, blocks in stored.layers.items()
    }
    arrays = {name: (array.tobytes(), array.shape) for name, array in stored.arrays.items()}
    return layers, arrays, stored.frame, stored.made, dict(stored.calibration)


def partition(blocks):
    """Return what tells one partition of points from another: cell, bottom, top, n and kind of every block, sorted."""
    rows = zip(blocks.cells.tolist(), blocks.bottom, blocks.height, blocks.count, blocks.type)
    return sorted((tuple(cell), bottom, height, n, kind) for cell, bottom, height, n, kind in rows)


def in_order(blocks):
    """Return the order of blocks by cell, then by bottom."""
    return np.lexsort((blocks.bottom, blocks.cells[:, 1], blocks.cells[:, 0]))


def blocks_of(intervals, resolution=0.5):
    """Return one block for each (bottom, top), in cells (0, 0), (1, 0), (2, 0) and so on."""
    rows = np.zeros((len(intervals), 11))
    for index, (bottom, top) in enumerate(intervals):
        rows[index] = [(index + 0.3) * resolution, 0.2, (bottom + top) / 2, 40, 1, 2, 3, 4, 2, bottom, top]
    return Blocks.uncrossed(rows, resolution)
