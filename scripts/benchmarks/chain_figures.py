"""The whole chain, from beams to the blocks of the map: what each stage takes of a core.

With NUMBA_DISABLE_JIT=1 it tells what compiling a stage's loops is worth.
"""

import time
from typing import List

import numpy as np

from benchmarks.harness import ROOT, Row
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
STAGES = ("beams to cloud", "threshold", "statistical outlier removal", "insertion")


def recorded_scans() -> List[List[PlacedBeam]]:
    """Return the beams of each complete scan of the recorded tour of the basin; the last one completes the scan."""
    assembler, scans, scan = ScanAssembler(SonarToCloudParameters()), [], []
    for beam in read_recording(ROOT / "test/data/basin.bag", Request()).beams:
        scan.append(beam)
        if assembler.add(beam) is not None:
            scans.append(scan)
            scan = []
    return scans


def stage_seconds(scans: List[List[PlacedBeam]]) -> np.ndarray:
    """Return the CPU seconds of each stage, summed over the scans (4,)."""
    assembler, surface_map = ScanAssembler(SonarToCloudParameters()), MultiLevelSurfaceMap(RESOLUTION)
    thresholder, remover = Thresholder(ThresholderParameters()), OutlierRemover(OutlierRemoverParameters())
    seconds = np.zeros(len(STAGES))
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


def rows() -> List[Row]:
    """Return the time of each stage and their sum, with quartiles; the first round loads and fills caches."""
    scans = recorded_scans()
    taken = np.array([stage_seconds(scans) for _ in range(ROUNDS + 1)])[1:]
    low, middle, high = 1e3 * np.percentile(np.column_stack([taken, taken.sum(axis=1)]), [25, 50, 75], axis=0)
    return [
        (f"{stage} of {len(scans)} scans", f"{middle[n]:.1f} ms of CPU ({low[n]:.1f} to {high[n]:.1f})", "")
        for n, stage in enumerate((*STAGES, "beams to blocks"))
    ]
