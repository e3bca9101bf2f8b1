"""Insertion into the map, and the map's markers."""

import time
from functools import partial
from io import BytesIO
from typing import Dict, List

import numpy as np
from std_msgs.msg import Header

from benchmarks.table import Row, median_seconds
from mlsm_manager.ros.markers import BlockMarkers
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap

RESOLUTION = 0.5
SCAN_RADIUS = 50.0
SMALL, LARGE = 10_000, 1_000_000


def scan(rng: np.random.Generator, center: np.ndarray, points: int) -> np.ndarray:
    """Return random points (n, 4) all over a disc and its depth: the hardest case, nearly every point its own block."""
    result = np.empty((points, 4))
    result[:, :2] = center + rng.uniform(-SCAN_RADIUS, SCAN_RADIUS, (points, 2))
    result[:, 2] = rng.uniform(-5.5, 0.0, points)
    result[:, 3] = rng.uniform(0.0, 127.0, points)
    return result


def grown_map(blocks: int, extent: float, rng: np.random.Generator) -> MultiLevelSurfaceMap:
    """Return a map of at least `blocks` blocks."""
    surface_map = MultiLevelSurfaceMap(RESOLUTION)
    while len(surface_map) < blocks:
        surface_map.insert(scan(rng, rng.uniform(-extent, extent, 2), 20_000))
    return surface_map


def insertion_rows() -> List[Row]:
    """Measure insertion into a small and a large map, in turn, so that both see the same machine."""
    rng = np.random.default_rng(1)
    maps = {SMALL: grown_map(SMALL, 0.0, rng), LARGE: grown_map(LARGE, 900.0, rng)}
    seconds: Dict[int, List[float]] = {SMALL: [], LARGE: []}
    points = 60_000
    for _ in range(15):
        new = scan(rng, np.zeros(2), points)
        for size, surface_map in maps.items():
            seconds[size].append(median_seconds(lambda m=surface_map, s=new: m.insert(s), repeats=1))
    medians = {size: float(np.median(values)) for size, values in seconds.items()}
    ratio = float(np.median(np.array(seconds[LARGE]) / np.array(seconds[SMALL])))
    large = maps[LARGE]
    return [
        (f"insert into {LARGE} blocks", f"{points / medians[LARGE] / 1e6:.2f} million points/s", ">= 0.5"),
        (f"insert into {SMALL} blocks", f"{points / medians[SMALL] / 1e6:.2f} million points/s", ">= 0.5"),
        ("time in the large map / in the small one", f"{ratio:.2f}", "<= 1.2"),
        (f"memory in use by {len(large)} blocks", f"{large.nbytes / len(large):.0f} bytes/block", "<= 120"),
    ]


def density_rows() -> List[Row]:
    """Measure insertion of points all over a disc and of points on few cells."""
    rows, points = [], 60_000
    for name, radius in (
        ("nearly every point its own block", SCAN_RADIUS),
        ("20 points to a block", SCAN_RADIUS / 8.0),
    ):
        rng, seconds = np.random.default_rng(3), []
        surface_map = grown_map(SMALL, 0.0, np.random.default_rng(1))
        for _ in range(11):
            new = scan(rng, np.zeros(2), points)
            new[:, :2] *= radius / SCAN_RADIUS
            seconds.append(median_seconds(partial(surface_map.insert, new), repeats=1, clock=time.process_time))
        rate = f"{points / float(np.median(seconds)) / 1e6:.2f} million points/s of a core"
        rows.append((f"insert, {name}", rate, "C++: 1.6-10"))
    return rows


def marker_rows() -> List[Row]:
    """Measure one publication of 20,000 blocks."""
    rng = np.random.default_rng(2)
    surface_map = grown_map(20_000, 20.0, rng)
    markers, buffer = BlockMarkers(), BytesIO()

    def publish() -> None:
        buffer.seek(0)
        markers.whole(surface_map.blocks, Header(frame_id="map")).serialize(buffer)

    seconds = median_seconds(publish)
    size = f"{len(surface_map)} blocks, {len(buffer.getvalue()) / 1e6:.1f} MB"
    return [(f"markers of {size}", f"{1e3 * seconds:.1f} ms", "a few ms")]


def rows() -> List[Row]:
    """Return the figures of the map."""
    return insertion_rows() + density_rows() + marker_rows()
