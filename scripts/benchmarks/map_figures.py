"""The map: insertion, carving, fetching and markers in small and large ones, its files and its memory."""

from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import List

import numpy as np
from std_msgs.msg import Header

from benchmarks.harness import Row, cpu_seconds, median_seconds
from mlsm_manager.ros.markers import BlockMarkers
from mlsm_manager.surface_map.free_space import Carver, CarvingParameters, FirstEchoes
from mlsm_manager.surface_map.map_file import Layer, StoredMap, read_map, write_map
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap

RESOLUTION = 0.5
MILLION = 1_000_000
_SMALL = 10_000
_SCAN_RADIUS, _REACH = 50.0, 70.0
_ECHOES, _BEAM_WIDTH, _SCANS = 400, 0.0436, 20


def rows() -> List[Row]:
    """Return the figures of files of a million blocks, and of scans in a small map and in one of ten million."""
    rng = np.random.default_rng(2)
    return [*_file_rows(), *(row for size in (_SMALL, 10 * MILLION) for row in _scan_rows(_sea_floor(size, rng), rng))]


def _sea_floor(blocks: int, rng: np.random.Generator, points_per_block: int = 1) -> MultiLevelSurfaceMap:
    """Return a map of a floor in a square, one block per cell, so many points in each."""
    side = int(np.ceil(np.sqrt(blocks)))
    surface_map = MultiLevelSurfaceMap(RESOLUTION)
    for band in np.array_split(np.arange(side), max(blocks // MILLION, 1)):
        x, y = (axis.ravel() for axis in np.meshgrid(band, np.arange(side), indexing="ij"))
        cells = np.repeat(np.column_stack([x, y]) - side // 2, points_per_block, axis=0)
        places = (cells + rng.uniform(0.0, 1.0, cells.shape)) * RESOLUTION
        depth = -10.0 + np.sin(places[:, 0] / 30.0) + rng.normal(0.0, 0.05, len(places))
        surface_map.insert(np.column_stack([places, depth, rng.uniform(0.0, 127.0, len(places))]))
    return surface_map


def _file_rows() -> List[Row]:
    """Measure saving and loading, up to a map that takes points, and the bytes."""
    blocks = _sea_floor(MILLION, np.random.default_rng(1), 4).blocks
    with TemporaryDirectory() as folder:
        path = Path(folder) / "floor.mlsm"
        save = median_seconds(lambda: write_map(path, StoredMap("map", {Layer.SHOWN: blocks})), 1)
        load = median_seconds(lambda: MultiLevelSurfaceMap(RESOLUTION).insert_blocks(read_map(path).shown), 1)
        size = path.stat().st_size / len(blocks)
    return [
        (f"save {len(blocks)} blocks", f"{save:.2f} s", "< 2 s"),
        (f"load {len(blocks)} blocks into a map", f"{load:.2f} s", "< 2 s"),
        ("size of the file", f"{size:.1f} bytes/block", "<= 40"),
    ]


def _scan_rows(surface_map: MultiLevelSurfaceMap, rng: np.random.Generator) -> List[Row]:
    """Measure what a scan costs in a map."""
    markers, free, carver = BlockMarkers(), MultiLevelSurfaceMap(RESOLUTION), Carver(CarvingParameters(), _BEAM_WIDTH)
    surface_map.take_changed_tiles()
    box, buffer, taken = np.full(2, _REACH), BytesIO(), []

    def publish() -> None:
        tiles = surface_map.take_changed_tiles()
        message = markers.changed(surface_map.in_tiles(tiles), map(tuple, tiles.tolist()), Header(frame_id="map"))
        message.serialize(buffer)

    for _ in range(_SCANS):
        points = _echoes(rng)
        beams = FirstEchoes.of_points(points, np.arange(_ECHOES), points[:, :3] * [0.0, 0.0, 1.0])
        calls = {
            f"insert {_ECHOES} echoes": lambda p=points: surface_map.insert(p),
            f"carve {_ECHOES} beams": lambda p=points, b=beams: carver.carve(surface_map, free, b, p),
            "markers of a scan's change": publish,
            f"fetch {2 * _REACH:.0f} m x {2 * _REACH:.0f} m for a match": lambda: surface_map.in_box(-box, box),
        }
        taken.append([cpu_seconds(call) for call in calls.values()])
    wanted = ("no slower", "no slower", "< 20 ms", "<= 17 ms")
    figures = [f"{1e3 * seconds:.1f} ms" for seconds in np.median(taken, axis=0)]
    size = f"{surface_map.nbytes / len(surface_map):.0f} bytes/block"
    found = [*zip(calls, figures, wanted), ("memory", size, "<= 156")]
    return [(f"{what}, map of {len(surface_map)} blocks", *rest) for what, *rest in found]


def _echoes(rng: np.random.Generator) -> np.ndarray:
    """Return the points (n, 4) of one scan around the map's middle: echoes at wandering ranges."""
    angle = np.linspace(0.0, 2.0 * np.pi, _ECHOES, endpoint=False)
    reach = _SCAN_RADIUS * (0.6 + 0.3 * np.sin(3.0 * angle + rng.uniform(0.0, 6.0))) + rng.normal(0.0, 0.2, _ECHOES)
    level = np.tile([-2.0, 60.0], (_ECHOES, 1))
    return np.column_stack([reach * np.cos(angle), reach * np.sin(angle), level])
