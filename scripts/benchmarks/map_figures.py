"""What the way from beams to the map costs: the stages, carving, and insertion, files and markers of large maps."""

import time
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Iterator, List

import numpy as np
from std_msgs.msg import Header

from benchmarks.harness import MARINA, ROOT, Row, median_seconds, recorded
from mlsm_manager.localisation.parameters import EstimatorName
from mlsm_manager.offline.map_bag import map_bag_arguments
from mlsm_manager.offline.recording import read_recording, scans_of
from mlsm_manager.offline.suited_parameters import odometry_of, with_odometry
from mlsm_manager.ros.markers import BlockMarkers
from mlsm_manager.surface_map.free_space import Carver, CarvingParameters, FirstEchoes
from mlsm_manager.surface_map.map_file import Layer, StoredMap, read_map, write_map
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from recordings.reader import Request
from sonar_processing.beams.beam import PlacedBeam
from sonar_processing.filters.echo_extractor import EchoExtractor
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters

RESOLUTION = 0.5
MILLION = 1_000_000
_SMALL = 10_000
_SCAN_RADIUS, _REACH = 50.0, 70.0
_ECHOES, _BEAM_WIDTH, _SCANS = 400, 0.0436, 20
_WARM_UP = 10  # scans until there is a map to be matched with and free space to be known
_ROUNDS = 9
_STAGES = ("beams to cloud", "threshold", "statistical outlier removal", "insertion", "beams to blocks")


def rows() -> Iterator[Row]:
    """Yield the figures of files of a million blocks, and of scans in a small map and in one of ten million."""
    blocks = _sea_floor(MILLION, np.random.default_rng(1), 4).blocks
    with TemporaryDirectory() as folder:
        path = Path(folder) / "floor.mlsm"
        save = median_seconds(lambda: write_map(path, StoredMap("map", {Layer.SHOWN: blocks})), 1)
        load = median_seconds(lambda: MultiLevelSurfaceMap(RESOLUTION).insert_blocks(read_map(path).shown), 1)
        size = path.stat().st_size / len(blocks)
    yield f"save {len(blocks)} blocks", f"{save:.2f} s", "< 2 s"
    yield f"load {len(blocks)} blocks into a map", f"{load:.2f} s", "< 2 s"
    yield "size of the file", f"{size:.1f} bytes/block", "<= 40"
    rng = np.random.default_rng(2)
    for number in (_SMALL, 10 * MILLION):
        yield from _scan_rows(_sea_floor(number, rng), rng)


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
        taken.append([median_seconds(call, 1, time.process_time) for call in calls.values()])
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


def carving_rows() -> Iterator[Row]:
    """Yield the share of a scan's time that carving takes in a real run, with each estimator; no truth is read."""
    path = str(recorded(MARINA))
    for estimator in EstimatorName:
        options = map_bag_arguments([path, "--out", "nowhere", "--set", f"estimator={estimator.value}"])
        recording = read_recording(recorded(MARINA), options.request)
        parameters = with_odometry(options.parameters, odometry_of(recording).kind, options.fixed)
        localisers = [
            parameters.changed({"carve": carve}).build_localiser(recording.sonar_in_base) for carve in (True, False)
        ]
        seconds = [
            [median_seconds(lambda m=m, s=scan: m.take_scan(s), 1, time.process_time) for m in localisers]
            for scan, _ in scans_of(recording, EchoExtractor(parameters.echoes()))
        ]
        with_it, without = np.mean(seconds[_WARM_UP:], axis=0)
        text = f"{100 * (1.0 - without / with_it):.0f} % of {1e3 * with_it:.0f} ms of a core"
        yield f"carving, {estimator.value}, {len(seconds)} scans of a marina", text, "< 20 %"


def chain_rows() -> Iterator[Row]:
    """Yield what each stage takes of a core, and their sum, with quartiles.

    With NUMBA_DISABLE_JIT=1 it tells what compiling a stage's loops is worth.
    """
    scans = _recorded_scans()
    # The first round loads and fills caches.
    taken = np.array([_stage_seconds(scans) for _ in range(_ROUNDS + 1)])[1:]
    quartiles = 1e3 * np.percentile(np.column_stack([taken, taken.sum(axis=1)]), [25, 50, 75], axis=0)
    for stage, (low, middle, high) in zip(_STAGES, quartiles.T):
        yield f"{stage} of {len(scans)} scans", f"{middle:.1f} ms of CPU ({low:.1f} to {high:.1f})", ""


def _recorded_scans() -> List[List[PlacedBeam]]:
    """Return the beams of each complete scan of the recorded tour of the basin; the last one completes the scan."""
    assembler, scans, scan = ScanAssembler(SonarToCloudParameters()), [], []
    for beam in read_recording(ROOT / "test/data/basin.bag", Request()).beams:
        scan.append(beam)
        if assembler.add(beam) is not None:
            scans.append(scan)
            scan = []
    return scans


def _stage_seconds(scans: List[List[PlacedBeam]]) -> np.ndarray:
    """Return the CPU seconds of each stage, summed over the scans (4,)."""
    assembler, surface_map = ScanAssembler(SonarToCloudParameters()), MultiLevelSurfaceMap(RESOLUTION)
    thresholder, remover = Thresholder(ThresholderParameters()), OutlierRemover(OutlierRemoverParameters())
    seconds = np.zeros(4)
    for scan in scans:
        times = [time.process_time()]
        (cloud,) = [made for made in map(assembler.add, scan) if made is not None]
        times.append(time.process_time())
        strong = thresholder(cloud)
        times.append(time.process_time())
        kept = remover(strong)
        times.append(time.process_time())
        surface_map.insert(kept.points)
        times.append(time.process_time())
        seconds += np.diff(times)
    return seconds
