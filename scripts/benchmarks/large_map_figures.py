"""Files of a million blocks; insertion, fetching and publishing in a map of ten million."""

import threading
import time
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Callable, List, Tuple

import numpy as np
from std_msgs.msg import Header

from benchmarks import joint_map_figures
from benchmarks.table import Row, median_seconds
from mlsm_manager.ros.markers import BlockMarkers
from mlsm_manager.surface_map.files.array_file import ArrayFileError
from mlsm_manager.surface_map.files.map_file import (
    Layer,
    StoredMap,
    map_bytes,
    map_of_bytes,
    read_map,
    write_map,
)
from mlsm_manager.surface_map.free_space.beam_paths import FirstEchoes
from mlsm_manager.surface_map.free_space.carving import Carver, CarvingParameters
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from mlsm_manager.surface_map.running_copy import finished

RESOLUTION = 0.5
MILLION = 1_000_000
_POINTS_PER_BLOCK = 4
_ECHOES = 400
_BEAM_WIDTH = 0.0436
_RADIUS = 50.0
_REACH = 70.0
_SCANS = 20
_GROWN, _GROWTH = 10_000_000, 1000
_SCAN_PERIOD = 0.02
_MUTATIONS, _MUTATED_BLOCKS = 1000, 2000


def sea_floor(blocks: int, rng: np.random.Generator, points_per_block: int = 1) -> MultiLevelSurfaceMap:
    """Return a map of a floor in a square, one block per cell, so many points in each."""
    side = int(np.ceil(np.sqrt(blocks)))
    surface_map = MultiLevelSurfaceMap(RESOLUTION)
    for rows in np.array_split(np.arange(side), max(blocks // MILLION, 1)):
        x, y = (axis.ravel() for axis in np.meshgrid(rows, np.arange(side), indexing="ij"))
        cells = np.repeat(np.column_stack([x, y]) - side // 2, points_per_block, axis=0)
        places = (cells + rng.uniform(0.0, 1.0, cells.shape)) * RESOLUTION
        depth = -10.0 + np.sin(places[:, 0] / 30.0) + rng.normal(0.0, 0.05, len(places))
        surface_map.insert(np.column_stack([places, depth, rng.uniform(0.0, 127.0, len(places))]))
    return surface_map


def echoes(rng: np.random.Generator) -> np.ndarray:
    """Return the points (n, 4) of one scan around the map's middle: echoes at wandering ranges."""
    angle = np.linspace(0.0, 2.0 * np.pi, _ECHOES, endpoint=False)
    reach = _RADIUS * (0.6 + 0.3 * np.sin(3.0 * angle + rng.uniform(0.0, 6.0))) + rng.normal(0.0, 0.2, _ECHOES)
    return np.column_stack(
        [reach * np.cos(angle), reach * np.sin(angle), np.full(_ECHOES, -2.0), np.full(_ECHOES, 60.0)]
    )


def file_rows() -> List[Row]:
    """Measure saving and loading, up to a map that takes points, and the bytes."""
    blocks = sea_floor(MILLION, np.random.default_rng(1), _POINTS_PER_BLOCK).blocks
    with TemporaryDirectory() as folder:
        path = Path(folder) / "floor.mlsm"
        wall, cpu = _seconds(lambda: write_map(path, StoredMap("map", {Layer.SHOWN: blocks})))
        rows = [(f"save {len(blocks)} blocks", f"{wall:.2f} s ({cpu:.2f} s of a core)", "< 2 s")]
        size = path.stat().st_size / len(blocks)

        def load() -> None:
            MultiLevelSurfaceMap(RESOLUTION).insert_blocks(read_map(path).shown)

        wall, cpu = _seconds(load)
    rows.append((f"load {len(blocks)} blocks into a map", f"{wall:.2f} s ({cpu:.2f} s of a core)", "< 2 s"))
    return [*rows, ("size of the file", f"{size:.1f} bytes/block", "<= 40")]


def size_rows() -> List[Row]:
    """Measure what a scan costs in a small map and in one of ten million blocks."""
    rng = np.random.default_rng(2)
    rows = []
    for blocks in (MILLION // 100, 10 * MILLION):
        surface_map = sea_floor(blocks, rng)
        rows += [(f"{name}, map of {len(surface_map)} blocks", *rest) for name, *rest in _scan_rows(surface_map, rng)]
    return rows


def _scan_rows(surface_map: MultiLevelSurfaceMap, rng: np.random.Generator) -> List[Row]:
    markers, header, sizes = BlockMarkers(), Header(frame_id="map"), []
    surface_map.take_changed_tiles()
    inserted, carved, published, fetched = [], [], [], []
    free, carver = MultiLevelSurfaceMap(RESOLUTION), Carver(CarvingParameters(), _BEAM_WIDTH)
    for _ in range(_SCANS):
        points = echoes(rng)
        inserted.append(_seconds(lambda points=points: surface_map.insert(points))[1])
        origins = np.column_stack([np.zeros((_ECHOES, 2)), points[:, 2]])
        beams = FirstEchoes.of_points(points, np.arange(_ECHOES), origins)
        carved.append(_seconds(lambda beams=beams, points=points: carver.carve(surface_map, free, beams, points))[1])
        published.append(_seconds(lambda: sizes.append(_published(surface_map, markers, header)))[1])
        box = np.full(2, _REACH)
        fetched.append(median_seconds(lambda box=box: surface_map.in_box(-box, box), 1, time.process_time))
    return [
        (f"insert {_ECHOES} echoes", f"{1e3 * np.median(inserted):.1f} ms", "no slower"),
        (f"carve {_ECHOES} beams", f"{1e3 * np.median(carved):.1f} ms", "no slower"),
        ("markers of a scan's change", f"{1e3 * np.median(published):.1f} ms", "< 20 ms"),
        ("their size", f"{max(sizes) / 1e6:.2f} MB", "< 1 MB"),
        (
            f"fetch {2 * _REACH:.0f} m x {2 * _REACH:.0f} m for a match",
            f"{1e3 * np.median(fetched):.1f} ms",
            "<= 17 ms",
        ),
        ("memory", f"{surface_map.nbytes / len(surface_map):.0f} bytes/block", "<= 156"),
    ]


def _published(surface_map: MultiLevelSurfaceMap, markers: BlockMarkers, header: Header) -> int:
    tiles = surface_map.take_changed_tiles()
    buffer = BytesIO()
    markers.changed(surface_map.in_tiles(tiles), map(tuple, tiles.tolist()), header).serialize(buffer)
    return len(buffer.getvalue())


def _seconds(call: Callable[[], object]) -> Tuple[float, float]:
    """Return the seconds of wall time and of a core that a call takes."""
    wall, cpu = time.perf_counter(), time.process_time()
    call()
    return time.perf_counter() - wall, time.process_time() - cpu


def growth_rows() -> List[Row]:
    """Measure the longest insertion while a map grows to ten million blocks."""
    rng, surface_map, seconds = np.random.default_rng(5), MultiLevelSurfaceMap(RESOLUTION), []
    side = int(np.sqrt(_GROWN / _GROWTH))
    for number in range(_GROWTH):
        first = np.array([side * (number % 100), side * (number // 100)])
        cells = first + np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), axis=-1).reshape(-1, 2)
        points = np.column_stack([(cells + 0.5) * RESOLUTION, rng.uniform(-10.0, -9.9, (len(cells), 2))])
        seconds.append(_seconds(lambda points=points: surface_map.insert(points))[1])
    longest, usual = 1e3 * max(seconds), 1e3 * float(np.median(seconds))
    name = f"insertions of {side**2} blocks up to {len(surface_map)}"
    row = (name, f"median {usual:.0f} ms, longest {longest:.0f} ms of a core", "longest < 100 ms")
    return [row, _copy_row(surface_map)]


def _copy_row(surface_map: MultiLevelSurfaceMap) -> Row:
    """Measure how long scans wait while the map is copied to be saved, as Localiser.stored does."""
    lock, rng, waits = threading.RLock(), np.random.default_rng(7), []
    copying = threading.Thread(target=lambda: finished(surface_map.begin_copy(), lock))
    begun = time.perf_counter()
    copying.start()
    while copying.is_alive():
        asked = time.perf_counter()
        with lock:
            waits.append(time.perf_counter() - asked)
            surface_map.insert(echoes(rng))
        time.sleep(_SCAN_PERIOD)
    seconds = time.perf_counter() - begun
    name = f"longest wait of {len(waits)} scans while {len(surface_map)} blocks are copied to be saved"
    figure = f"{1e3 * max(waits):.0f} ms, {1e3 * _longest_piece(surface_map):.1f} ms of a core"
    return (name, f"{figure}; the copy takes {seconds:.1f} s", "< 100 ms")


def _longest_piece(surface_map: MultiLevelSurfaceMap) -> float:
    """Return the seconds of a core that the longest piece of a copy takes."""
    copy, seconds = surface_map.begin_copy(), []
    while not copy.is_complete:
        seconds.append(_seconds(copy.step)[1])
    return max(seconds)


def mutation_rows() -> List[Row]:
    """Change files of a map at random, and count those that are read as something else or end in an error of ours."""
    rng = np.random.default_rng(6)
    blocks = sea_floor(_MUTATED_BLOCKS, rng).blocks
    data = map_bytes(StoredMap("map", {Layer.SHOWN: blocks}, {"beam_width": 0.04}, 1.0, {"place": np.zeros(3)}))
    crashed = accepted = 0
    for _ in range(_MUTATIONS):
        try:
            map_of_bytes(_mutated(data, rng))
            accepted += 1
        except ArrayFileError:
            pass
        except Exception:
            crashed += 1
    return [(f"{_MUTATIONS} mutated files", f"{accepted} accepted, {crashed} crashed", "0, 0")]


def _mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """Return the bytes with one changed, some left out or some put in."""
    place, kind = int(rng.integers(len(data))), int(rng.integers(3))
    if kind == 0:
        return data[:place] + bytes([data[place] ^ int(rng.integers(1, 256))]) + data[place + 1 :]
    some = int(rng.integers(1, 9))
    if kind == 1:
        return data[:place] + data[place + some :]
    return data[:place] + rng.bytes(some) + data[place:]


def rows() -> List[Row]:
    """Return the figures of map files and of large maps."""
    return file_rows() + mutation_rows() + size_rows() + growth_rows() + joint_map_figures.rows()
