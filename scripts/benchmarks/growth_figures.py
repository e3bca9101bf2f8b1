"""How time and memory grow with the size of the map and of the scan: slopes of straight lines through log-log plots.

A slope of 0 means that size does not matter, 1 that twice the size costs twice as much.
"""

import time
from typing import Callable, List, Sequence

import numpy as np

from benchmarks.map_figures import RESOLUTION, grown_map, scan
from benchmarks.table import Row, median_seconds
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from sonar_processing.cloud import IntensityCloud
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters

MAP_BLOCKS = (10_000, 30_000, 100_000, 300_000, 1_000_000)
SCAN_POINTS = (2_000, 6_000, 20_000, 60_000)
INSERTED = 20_000
REPEATS = 7


def slope(sizes: Sequence[float], costs: Sequence[float]) -> float:
    """Return the slope of log cost over log size."""
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])


def map_rows() -> List[Row]:
    """Measure a scan's insertion, and memory, against the blocks that the map holds."""
    rng = np.random.default_rng(1)
    maps = [grown_map(blocks, 30.0 * (blocks / MAP_BLOCKS[0]) ** 0.5, rng) for blocks in MAP_BLOCKS]
    sizes = [len(surface_map) for surface_map in maps]
    seconds: List[List[float]] = [[] for _ in maps]
    for _ in range(REPEATS):
        new = scan(rng, np.zeros(2), INSERTED)
        for taken, surface_map in zip(seconds, maps):
            taken.append(median_seconds(lambda m=surface_map, s=new: m.insert(s), 1, time.process_time))
    return [
        _row("insertion of a scan against blocks in the map", sizes, np.median(seconds, axis=1), "s", "about 0"),
        _row("memory of the map against its blocks", sizes, [m.nbytes for m in maps], "bytes", "about 1"),
    ]


def scan_rows() -> List[Row]:
    """Measure the stages against the points of a scan."""
    rng = np.random.default_rng(2)
    clouds = [_cloud(rng, points) for points in SCAN_POINTS]
    threshold, remove = Thresholder(ThresholderParameters()), OutlierRemover(OutlierRemoverParameters())
    stages: List[tuple] = [
        ("threshold", threshold),
        ("statistical outlier removal", remove),
        ("insertion into an empty map", lambda cloud: MultiLevelSurfaceMap(RESOLUTION).insert(cloud.points)),
    ]
    return [_scan_row(name, stage, clouds) for name, stage in stages]


def _scan_row(name: str, stage: Callable[[IntensityCloud], object], clouds: List[IntensityCloud]) -> Row:
    seconds = [median_seconds(lambda c=cloud: stage(c), REPEATS, time.process_time) for cloud in clouds]
    return _row(f"{name} against points in the scan", SCAN_POINTS, seconds, "s", "about 1")


def _cloud(rng: np.random.Generator, points: int) -> IntensityCloud:
    return IntensityCloud(scan(rng, np.zeros(2), points).astype(np.float32), np.ones(points), 10**9, "odom")


def _row(what: str, sizes: Sequence[float], costs: Sequence[float], unit: str, wanted: str) -> Row:
    ends = f"{costs[0]:.3g} {unit} at {sizes[0]:,}, {costs[-1]:.3g} at {sizes[-1]:,}"
    return f"slope of {what}", f"{slope(sizes, costs):.2f} ({ends})", wanted


def rows() -> List[Row]:
    """Return all slopes."""
    return map_rows() + scan_rows()
