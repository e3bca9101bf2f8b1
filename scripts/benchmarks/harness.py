"""What every benchmark shares: where recordings are, timing a call, and printing what was found."""

import os
import sys
import time
from pathlib import Path
from typing import Callable, Iterable, List, Tuple, Union

import numpy as np

from mlsm_manager.offline.bag_mapping import MappedBag, mapped_bag
from mlsm_manager.offline.map_bag import map_bag_arguments
from mlsm_manager.offline.recording import Recording, read_recording
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import matrices
from recordings.motion.vehicle_motion import MotionNames, MotionSource
from recordings.reader import Request, read
from sonar_processing.beams.beam import Beam, PlacedBeam

ROOT = Path(__file__).resolve().parents[2]
MARINA, WHOLE_MARINA = "marina_first.bag", "marina_whole_blind.bag"
Row = Tuple[str, str, str]
"""What was measured, the figure with its unit, and what is wanted of it."""


class SkippedError(Exception):
    """A bench cannot be run here; the text says why."""


def recorded(name: str) -> Path:
    """Return the path of a recording, which may be missing: in the folder UMC_DATA, or beside the repository."""
    return Path(os.environ.get("UMC_DATA", str(ROOT.parent / "shared/data"))) / name


def recorded_beams(name: str) -> List[Beam]:
    """Return the beams of a recording of a vehicle at rest. Raises RecordingError."""
    return read(recorded(name), Request(motion=MotionNames(declared=MotionSource.STANDING))).recorded.beams


def marina(**asked: str) -> Recording:
    """Return the marina's first part; `asked`: of Request. Raises RecordingError."""
    return read_recording(recorded(MARINA), Request(**asked))


def placed(beams: List[Beam], odometry: Track, T_base_sonar: np.ndarray) -> List[PlacedBeam]:
    """Return beams of a vehicle on its way where its odometry puts a sonar at T_base_sonar (4, 4)."""
    places = matrices(odometry.at(np.array([beam.stamp_ns for beam in beams]) * 1e-9)) @ T_base_sonar
    return [PlacedBeam(beam, place, True) for beam, place in zip(beams, places)]


def mapped_as(recording: Recording, *options: str) -> MappedBag:
    """Return what `map_bag RECORDING OPTIONS` makes of a recording."""
    return mapped_bag(recording, map_bag_arguments(["recording", "--out", "nowhere", *options]))


def median_seconds(
    call: Callable[[], object], repeats: int = 20, clock: Callable[[], float] = time.perf_counter
) -> float:
    """Return the median time of a call; time.process_time counts only what this process gets of its core."""
    times = []
    for _ in range(repeats):
        start = clock()
        call()
        times.append(clock() - start)
    return float(np.median(times))


def say(words: str) -> None:
    """Tell beside the table what is done now, so that whoever waits knows for what."""
    print(f"{time.strftime('%H:%M:%S')} {words}", file=sys.stderr, flush=True)


def print_rows(found: Iterable[Union[str, Row]]) -> None:
    """Print lines as they come, or a table once it is whole."""
    table = []
    for one in found:
        if isinstance(one, str):
            print(one, flush=True)
        else:
            table.append(one)
    if not table:
        return
    lines = [("figure", "measured", "wanted"), *table]
    widths = [max(map(len, column)) for column in zip(*lines)]
    for line in [lines[0], ["-" * width for width in widths], *table]:
        print("  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip())
