"""How time and memory grow with the size of the map and of the scan and with the length of the run: slopes of straight
lines through log-log plots.

A slope of 0 means that size does not matter, 1 that twice the size costs twice as much.
"""

import resource
import time
from pathlib import Path
from typing import Callable, List, Sequence

import numpy as np

from benchmarks.long_run import tour_scans
from benchmarks.map_figures import RESOLUTION, grown_map, scan
from benchmarks.table import Row, median_seconds
from mlsm_manager.joint_solver.parameters import MultiViewParameters
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from sonar_processing.cloud import IntensityCloud
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters

MAP_BLOCKS = (10_000, 30_000, 100_000, 300_000, 1_000_000)
SCAN_POINTS = (2_000, 6_000, 20_000, 60_000)
RUN_SCANS = (75, 150, 300)
RUN_AVERAGED = 25  # scans before each of these: those of one round of the tour
INSERTED = 20_000
REPEATS = 7


def slope(sizes: Sequence[float], costs: Sequence[float]) -> float:
    """Return the slope of log cost over log size."""
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])


def run_rows() -> List[Row]:
    """Measure what a scan costs the live joint solver, and the memory of the process, against the scans before it."""
    solver = LiveSolver(MultiViewParameters(), np.zeros(2))
    seconds: List[float] = []
    before, grown = _resident_bytes(), []
    for number, new in enumerate(tour_scans(RUN_SCANS[-1]), start=1):
        seconds.append(median_seconds(lambda s=new: solver.add(s), 1, time.process_time))
        if number in RUN_SCANS:
            grown.append(_resident_bytes() - before)
    costs = [float(np.median(seconds[number - RUN_AVERAGED : number])) for number in RUN_SCANS]
    return [
        _row("a scan's time in the joint solver against scans in the run", RUN_SCANS, costs, "s", "about 0"),
        _row("memory of the joint solver against scans in the run", RUN_SCANS, grown, "bytes", "at most 1"),
    ]


def _resident_bytes() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize()


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
    # The run first: it is measured by the memory of the process, which the large maps leave free afterwards.
    return run_rows() + map_rows() + scan_rows()
