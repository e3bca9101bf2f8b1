"""What a scan costs the joint estimator in a small map and in a large one, with and without carving."""

import time
from io import BytesIO
from typing import List, NamedTuple, Tuple

import numpy as np
from std_msgs.msg import Header

from benchmarks.table import Row
from mlsm_manager.localisation.clouds import Cloud
from mlsm_manager.localisation.joint import Joint
from mlsm_manager.localisation.joint_parameters import EstimatorName
from mlsm_manager.localisation.parameters import LocaliserParameters
from mlsm_manager.ros.markers import BlockMarkers
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.files.map_file import Layer
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap

RESOLUTION = 0.5
_WALLS_APART = 40.0
_WALL_LENGTH = 12_000.0
_TURN = 14.0
_BEAMS = 400
_SPEED = 0.3
_WARM_UP = 42
"""Scans until the window of 40 is full, from where on a scan costs what it will always cost."""
_SCANS = 12


class Costs(NamedTuple):
    """Seconds of a core: first and median of a whole scan, the markers of its change; and bytes of these.

    for_carving: share of a scan.
    """

    first: float
    scan: float
    markers: float
    size: int
    for_carving: float


def walls(blocks: int) -> Blocks:
    """Return parallel walls, `_WALLS_APART` m from each other, a block for each cell of each."""
    length = min(_WALL_LENGTH, blocks * RESOLUTION / 2.0)
    x = np.arange(-length / 2.0, length / 2.0, RESOLUTION) + RESOLUTION / 2.0
    count = int(np.ceil(blocks / len(x)))
    surface_map = MultiLevelSurfaceMap(RESOLUTION, limit=1e6)
    for y in (np.arange(count) - count // 2) * _WALLS_APART + 0.25:
        points = np.column_stack([x, np.full(len(x), y), np.full(len(x), -2.0), np.full(len(x), 60.0)])
        surface_map.insert(points)
    return surface_map.blocks


def scan(number: int, rng: np.random.Generator) -> Scan:
    """Return a scan of a vehicle that goes along the middle between two walls."""
    times = _TURN * (number + (np.arange(_BEAMS) + 1.0) / _BEAMS)
    bearing = np.linspace(0.0, 2.0 * np.pi, _BEAMS, endpoint=False)
    reach = np.minimum(_WALLS_APART / 2.0 / np.maximum(np.abs(np.sin(bearing)), 1e-9), 60.0)
    heard = reach < 60.0
    reach = reach + rng.normal(0.0, 0.1, _BEAMS)
    places = np.column_stack([_SPEED * times + reach * np.cos(bearing), 20.25 + reach * np.sin(bearing)])[heard]
    track_times = np.arange(_TURN * (number - 1), _TURN * (number + 1) + 2.0, 0.2)
    track = np.column_stack([_SPEED * track_times, np.full(len(track_times), 20.25), np.zeros(len(track_times))])
    points = np.column_stack([places, np.full(len(places), -2.0), np.full(len(places), 60.0)])
    return Scan(points, times[heard], np.ones(len(places), dtype=bool), Track(track_times, track), float(times[-1]))


def costs(known: Blocks) -> Costs:
    """Measure scans in a map that has `known` blocks already, in turn with and without carving."""
    carving, plain = _estimator_in(known, carve=True), _estimator_in(known, carve=False)
    rng, markers, header = np.random.default_rng(4), BlockMarkers(), Header(frame_id="map")
    taken, without, published, sizes = [], [], [], []
    for number in range(_WARM_UP + _SCANS):
        one = scan(number, rng)
        taken.append(_cpu(lambda one=one: _take(carving, one)))
        without.append(_cpu(lambda one=one: _take(plain, one)))
        published.append(_cpu(lambda: sizes.append(_published(carving, markers, header))))
    newest = slice(_WARM_UP, None)
    share = float(np.median(1.0 - np.array(without[newest]) / np.array(taken[newest])))
    return Costs(
        taken[0], float(np.median(taken[newest])), float(np.median(published[newest])), max(sizes[newest]), share
    )


def _estimator_in(known: Blocks, carve: bool) -> Joint:
    parameters = LocaliserParameters(estimator=EstimatorName.JOINT, carve=carve, match_resolution=RESOLUTION)
    estimator = parameters.build_localiser().estimator
    estimator.restore({Layer.SHOWN: known.take(slice(0, 1)), Layer.MATCHED: known}, {})
    return estimator


def _take(estimator: Joint, one: Scan) -> None:
    estimator.add_scan(one)
    estimator.add_cloud(Cloud.of_scan(one))


def _cpu(call) -> float:
    start = time.process_time()
    call()
    return time.process_time() - start


def _published(estimator: Joint, markers: BlockMarkers, header: Header) -> int:
    tiles, buffer = estimator.shown.take_changed_tiles(), BytesIO()
    markers.changed(estimator.shown.in_tiles(tiles), map(tuple, tiles.tolist()), header).serialize(buffer)
    return len(buffer.getvalue())


def rows(sizes: Tuple[int, ...] = (10_000, 10_000_000)) -> List[Row]:
    """Return the figures of the joint estimator."""
    result = []
    for size in sizes:
        known = walls(size)
        found = costs(known)
        name = f"map of {len(known)} blocks"
        result += [
            (f"JOINT: a scan of {_BEAMS} beams, {name}", f"{1e3 * found.scan:.0f} ms of a core", "no slower"),
            ("JOINT: of that for carving", f"{100 * found.for_carving:.0f} %", "< 20 %"),
            ("JOINT: the first scan in that map", f"{found.first:.2f} s", ""),
            ("JOINT: markers of a scan's change", f"{1e3 * found.markers:.1f} ms", "< 20 ms"),
            ("JOINT: their size", f"{found.size / 1e6:.2f} MB", "< 1 MB"),
        ]
    return result
