"""The whole chain, from beams to the markers of the map, against plain C++ that does the same."""

import shutil
import struct
import subprocess
import tempfile
import time
from io import BytesIO
from pathlib import Path
from typing import Dict, List, Tuple

import numpy as np
from std_msgs.msg import Header

from benchmarks.basin_messages import basin_messages
from benchmarks.in_turn import ratio_figure
from benchmarks.map_figures import RESOLUTION
from benchmarks.table import Row
from mlsm_manager.ros.markers import BlockMarkers
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters
from sonar_processing.messages.parameters import BeamMessageParameters
from sonar_processing.messages.reader import BeamReader
from sonar_processing.messages.type_table import OWN
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters

ROUNDS = 9
SOURCE = Path(__file__).with_name("chain.cpp")
STAGES = ("beams to cloud", "threshold", "statistical outlier removal", "insertion", "markers")
_BEAM = struct.Struct("<19di")


def recorded_beams() -> List[PlacedBeam]:
    """Return the beams of the recorded tour of the basin in the frame odom."""
    messages, poses = basin_messages()
    reader = BeamReader(BeamMessageParameters())
    beams = [beam for message in messages for beam in reader.read(OWN, message).beams]
    return [PlacedBeam(beam, poses[beam.stamp_ns], is_moving=False) for beam in beams]


def scans_of(beams: List[PlacedBeam]) -> List[List[PlacedBeam]]:
    """Return the beams of each complete scan; each ends with the beam that completes it."""
    assembler, scans, scan = ScanAssembler(SonarToCloudParameters()), [], []
    for beam in beams:
        scan.append(beam)
        if assembler.add(beam) is not None:
            scans.append(scan)
            scan = []
    return scans


def run(scans: List[List[PlacedBeam]], whole: bool) -> Tuple[np.ndarray, int, int]:
    """Return the CPU seconds of each stage, summed over the scans (5,), and the numbers of points and blocks.

    whole: whether the markers are those of all blocks, as the thesis's and the C++'s, or of what changed, as ours live.
    """
    assembler, markers = ScanAssembler(SonarToCloudParameters()), BlockMarkers()
    thresholder = Thresholder(ThresholderParameters())
    remover = OutlierRemover(OutlierRemoverParameters())
    surface_map = MultiLevelSurfaceMap(RESOLUTION)
    seconds, points = np.zeros(len(STAGES)), 0
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
        _send(markers, surface_map, whole)
        times.append(time.process_time())
        seconds += np.diff(times)
        points += len(kept)
    return seconds, points, len(surface_map)


def _send(markers: BlockMarkers, surface_map: MultiLevelSurfaceMap, whole: bool) -> None:
    header = Header(frame_id="map")
    if whole:
        message = markers.whole(surface_map.blocks, header)
    else:
        tiles = surface_map.take_changed_tiles()
        message = markers.changed(surface_map.in_tiles(tiles), map(tuple, tiles.tolist()), header)
    message.serialize(BytesIO())


def _write(scans: List[List[PlacedBeam]], path: Path) -> None:
    with path.open("wb") as file:
        for scan in scans:
            for placed in scan:
                beam = placed.beam
                numbers = [*placed.T_target_sonar.ravel(), beam.angle, beam.range_resolution, placed.signed_stamp]
                file.write(_BEAM.pack(*numbers, beam.intensities.size) + beam.intensities.tobytes())
            file.write(_BEAM.pack(*[0.0] * 19, 0))


def rows() -> List[Row]:
    """Compare each stage and their sum."""
    if shutil.which("g++") is None:
        return [("whole chain by C++", "not measured: no g++", "")]
    scans = scans_of(recorded_beams())
    variants = {"all markers": True, "changed markers": False}
    ours: Dict[str, List[np.ndarray]] = {name: [] for name in variants}
    theirs: List[List[float]] = []
    with tempfile.TemporaryDirectory() as folder:
        program, data = Path(folder) / "chain", Path(folder) / "beams"
        subprocess.run(["g++", "-O2", "-o", str(program), str(SOURCE)], check=True)
        _write(scans, data)
        for turn in range(ROUNDS + 1):
            *seconds, points, blocks, _ = map(float, subprocess.check_output([str(program), str(data)]).split())
            taken = {name: _checked(run(scans, whole), points, blocks) for name, whole in variants.items()}
            if turn:  # The first round loads and fills caches
                theirs.append(seconds)
                for name in variants:
                    ours[name].append(taken[name])
    return [
        row
        for name, mine in ours.items()
        for row in _rows(f"{len(scans)} scans, {name}", np.array(mine), np.array(theirs))
    ]


def _checked(result: Tuple[np.ndarray, int, int], points: float, blocks: float) -> np.ndarray:
    """Return the seconds of a result; raises RuntimeError where C++ has other numbers of points or blocks."""
    seconds, our_points, our_blocks = result
    if (our_points, our_blocks) != (points, blocks):
        raise RuntimeError(f"C++: {points:.0f} points, {blocks:.0f} blocks; ours: {our_points}, {our_blocks}")
    return seconds


def _rows(what: str, ours: np.ndarray, theirs: np.ndarray) -> List[Row]:
    columns = [(stage, ours[:, number], theirs[:, number]) for number, stage in enumerate(STAGES)]
    columns.append(("beams to markers", ours.sum(axis=1), theirs.sum(axis=1)))
    return [
        (
            f"{stage} ({what}): plain C++ over ours of {1e3 * float(np.median(mine)):.1f} ms of CPU",
            ratio_figure(others / mine)[0],
            ">= 3" if stage == "beams to markers" else "",
        )
        for stage, mine, others in columns
    ]
