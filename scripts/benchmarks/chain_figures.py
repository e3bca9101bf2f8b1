"""The whole chain, from beams to the markers of the map, against plain C++ that does the same."""

import shutil
import struct
import subprocess
import tempfile
import time
from io import BytesIO
from pathlib import Path
from typing import List, Tuple

import numpy as np
import rosbag
from std_msgs.msg import Header

from benchmarks.harness import ROOT, Row, ratio_text
from benchmarks.map_figures import RESOLUTION
from mlsm_manager.ros.markers import BlockMarkers
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.ros.transforms import matrix_from_message
from sonar_processing.beams.beam import PlacedBeam
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters
from sonar_processing.messages.beam_types import OWN
from sonar_processing.messages.reader import BeamMessageParameters, BeamReader
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters

ROUNDS = 9
SOURCE = Path(__file__).with_name("chain.cpp")
STAGES = ("beams to cloud", "threshold", "statistical outlier removal", "insertion", "markers")
_BEAM = struct.Struct("<18di")


def recorded_beams() -> List[PlacedBeam]:
    """Return the beams of the recorded tour of the basin in the frame odom."""
    reader, poses, beams = BeamReader(BeamMessageParameters()), {}, []
    with rosbag.Bag(str(ROOT / "test/data/basin.bag")) as bag:
        for topic, message, stamp in bag.read_messages(["/sonar/raw", "/tf"]):
            if topic == "/tf":
                poses[stamp.to_nsec()] = matrix_from_message(message.transforms[0].transform)
            else:
                beams += reader.read(OWN, message).beams
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


def run(scans: List[List[PlacedBeam]]) -> Tuple[np.ndarray, Tuple[int, int]]:
    """Return the CPU seconds of each stage, summed over the scans (5,), and the numbers of points and blocks."""
    assembler, markers = ScanAssembler(SonarToCloudParameters()), BlockMarkers()
    thresholder, remover = Thresholder(ThresholderParameters()), OutlierRemover(OutlierRemoverParameters())
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
        # All of them, as the thesis's node and the C++ do; ours publishes what changed.
        markers.whole(surface_map.blocks, Header(frame_id="map")).serialize(BytesIO())
        times.append(time.process_time())
        seconds += np.diff(times)
        points += len(kept)
    return seconds, (points, len(surface_map))


def _write(scans: List[List[PlacedBeam]], path: Path) -> None:
    with path.open("wb") as file:
        for scan in scans:
            for placed in scan:
                beam = placed.beam
                numbers = [*placed.T_target_sonar.ravel(), beam.angle, beam.range_resolution]
                file.write(_BEAM.pack(*numbers, beam.intensities.size) + beam.intensities.tobytes())
            file.write(_BEAM.pack(*[0.0] * 18, 0))


def rows() -> List[Row]:
    """Compare each stage and their sum. Raises RuntimeError where C++ has other numbers of points or blocks."""
    if shutil.which("g++") is None:
        return [("whole chain by C++", "not measured: no g++", "")]
    scans, ours, theirs = scans_of(recorded_beams()), [], []
    with tempfile.TemporaryDirectory() as folder:
        program, data = Path(folder) / "chain", Path(folder) / "beams"
        subprocess.run(["g++", "-O2", "-o", str(program), str(SOURCE)], check=True)
        _write(scans, data)
        for _ in range(ROUNDS + 1):
            *seconds, points, blocks = map(float, subprocess.check_output([str(program), str(data)]).split())
            taken, counts = run(scans)
            if counts != (points, blocks):
                raise RuntimeError(f"C++: {points:.0f} points, {blocks:.0f} blocks; ours: {counts}")
            ours.append([*taken, taken.sum()])
            theirs.append([*seconds, sum(seconds)])
    mine, others = np.array(ours)[1:], np.array(theirs)[1:]  # The first round loads and fills caches
    names = [f"{stage} of {len(scans)} scans: plain C++ over ours of" for stage in (*STAGES, "beams to markers")]
    return [
        (f"{name} {1e3 * float(np.median(own)):.1f} ms of CPU", ratio_text(other / own), "")
        for name, own, other in zip(names, mine.T, others.T)
    ]
