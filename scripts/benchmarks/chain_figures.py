"""The whole chain, from beams to the blocks of the map, against plain C++ that does the same."""

import shutil
import struct
import subprocess
import tempfile
import time
from pathlib import Path
from typing import List, Tuple

import numpy as np

from benchmarks.harness import ROOT, Row, ratio_text
from benchmarks.map_figures import RESOLUTION
from mlsm_manager.offline.recording import read_recording
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from recordings.reader import Request
from sonar_processing.beams.beam import PlacedBeam
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters

ROUNDS = 9
SOURCE = Path(__file__).with_name("chain.cpp")
STAGES = ("beams to cloud", "threshold", "statistical outlier removal", "insertion")
_BEAM = struct.Struct("<18di")


def recorded_scans() -> List[List[PlacedBeam]]:
    """Return the beams of each complete scan of the recorded tour of the basin; the last one completes the scan."""
    assembler, scans, scan = ScanAssembler(SonarToCloudParameters()), [], []
    for beam in read_recording(ROOT / "test/data/basin.bag", Request()).beams:
        scan.append(beam)
        if assembler.add(beam) is not None:
            scans.append(scan)
            scan = []
    return scans


def run(scans: List[List[PlacedBeam]]) -> Tuple[np.ndarray, Tuple[int, int]]:
    """Return the CPU seconds of each stage, summed over the scans (4,), and the numbers of points and blocks."""
    assembler, surface_map = ScanAssembler(SonarToCloudParameters()), MultiLevelSurfaceMap(RESOLUTION)
    thresholder, remover = Thresholder(ThresholderParameters()), OutlierRemover(OutlierRemoverParameters())
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
    scans, ours, theirs = recorded_scans(), [], []
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
    names = [f"{stage} of {len(scans)} scans: plain C++ over ours of" for stage in (*STAGES, "beams to blocks")]
    return [
        (f"{name} {1e3 * float(np.median(own)):.1f} ms of CPU", ratio_text(other / own), "")
        for name, own, other in zip(names, mine.T, others.T)
    ]
