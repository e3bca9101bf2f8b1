"""Each stage against what a user would pick instead, on the same input and in the same run."""

import math
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Callable, Dict, List, Tuple

import numpy as np

from benchmarks.in_turn import OURS, comparison_rows
from benchmarks.map_figures import RESOLUTION
from benchmarks.table import Row
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from sonar_processing.filters.outliers import radius_inliers, statistical_inliers

NEIGHBORS, DEVIATIONS = 20, 1.0
RADIUS = 1.0
BEAMS, REACH = 120, 50.0
MAP_POINTS = 20_000


def basin_points(count: int, seed: int) -> np.ndarray:
    """Return (count, 4) float32: points of one turn above the threshold, three fifths of them on a round wall."""
    rng = np.random.default_rng(seed)
    angles = 2.0 * math.pi * rng.integers(0, BEAMS, count) / BEAMS
    on_wall = rng.uniform(size=count) < 0.6
    ranges = np.where(on_wall, rng.normal(20.0, 0.5, count), rng.uniform(1.0, REACH, count))
    heights = rng.normal(-2.0, 0.05, count)
    strengths = rng.uniform(40.0, 127.0, count)
    return np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles), heights, strengths]).astype(np.float32)


def outlier_rows() -> List[Row]:
    """Compare both rules with Open3D's, from numpy array to numpy array."""
    if find_spec("open3d") is None:
        return [("outlier removal by Open3D", "not measured: no Open3D", "")]
    geometry, to_vectors = import_module("open3d").geometry, import_module("open3d").utility.Vector3dVector

    def statistical(points: np.ndarray) -> np.ndarray:
        cloud = geometry.PointCloud(to_vectors(points.astype(np.float64)))
        return np.asarray(cloud.remove_statistical_outlier(NEIGHBORS + 1, DEVIATIONS)[1])

    def radius(points: np.ndarray) -> np.ndarray:
        cloud = geometry.PointCloud(to_vectors(points.astype(np.float64)))
        return np.asarray(cloud.remove_radius_outlier(NEIGHBORS, RADIUS)[1])

    rows: List[Row] = []
    for count in (2_000, 20_000):
        points = np.ascontiguousarray(basin_points(count, 0)[:, :3])
        rows += comparison_rows(
            f"statistical outlier removal, {count:,} points",
            {
                OURS: lambda p=points: statistical_inliers(p, NEIGHBORS, DEVIATIONS),
                "Open3D": lambda p=points: statistical(p),
            },
        )
        rows += comparison_rows(
            f"radius outlier removal, {count:,} points",
            {OURS: lambda p=points: radius_inliers(p, RADIUS, NEIGHBORS), "Open3D": lambda p=points: radius(p)},
        )
    return rows


class CellDictionary:
    """A plain dict of cells with number, sums, lowest and highest point: a map as one would begin it."""

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution
        self.cells: Dict[Tuple[int, int], List[float]] = {}

    def insert(self, points: np.ndarray) -> None:
        """Insert points (n, 4)."""
        columns, rows = np.floor(points[:, :2] / self._resolution).astype(np.int64).T.tolist()
        for key, (_, _, z, strength) in zip(zip(columns, rows), points.tolist()):
            cell = self.cells.get(key)
            if cell is None:
                self.cells[key] = [1.0, z, z * z, strength, z, z]
                continue
            cell[0] += 1.0
            cell[1] += z
            cell[2] += z * z
            cell[3] += strength
            cell[4] = min(cell[4], z)
            cell[5] = max(cell[5], z)


def insertion_rows() -> List[Row]:
    """Compare insertion of scans into a map that holds some: without free space, for only OctoMap's rays find that."""
    scans = [basin_points(MAP_POINTS, seed) for seed in range(6)]
    makers: Dict[str, Callable[[], Callable[[np.ndarray], object]]] = {
        OURS: lambda: MultiLevelSurfaceMap(RESOLUTION).insert,
        "a plain dict of cells": lambda: CellDictionary(RESOLUTION).insert,
    }
    absent: List[Row] = []
    if find_spec("pyoctomap") is None:
        absent = [("insertion into OctoMap", "not measured: no pyoctomap", "")]
    else:
        makers["OctoMap, end points only"] = lambda: _octomap_ends(import_module("pyoctomap").OcTree(RESOLUTION))
        makers["OctoMap, with rays"] = lambda: _octomap_rays(import_module("pyoctomap").OcTree(RESOLUTION))
    task = f"insert {len(scans)} scans of {MAP_POINTS:,} points"
    calls = {name: lambda make=make: _insert_all(make(), scans) for name, make in makers.items()}
    return comparison_rows(task, calls, repeats=9) + absent


def _insert_all(insert: Callable[[np.ndarray], object], scans: List[np.ndarray]) -> None:
    for scan in scans:
        insert(scan)


def _octomap_ends(tree: Any) -> Callable[[np.ndarray], object]:
    return lambda points: tree.updateNodes(points[:, :3].astype(np.float64), True, True)


def _octomap_rays(tree: Any) -> Callable[[np.ndarray], object]:
    origin = np.array([0.0, 0.0, -2.0])
    return lambda points: tree.insertPointCloud(
        points[:, :3].astype(np.float64), origin, lazy_eval=True, discretize=True
    )


def rows() -> List[Row]:
    """Return the comparisons."""
    return outlier_rows() + insertion_rows()
