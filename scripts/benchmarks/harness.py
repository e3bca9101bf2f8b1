"""What every benchmark shares: where recordings are, timing a call, running a node, and printing a table."""

import argparse
import os
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import Callable, List, Tuple

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


def missing_row(name: str) -> Row:
    """Return the row that stands for figures of a recording that is not there."""
    return name, "skipped", f"not in {recorded('')}; set UMC_DATA"


def run_node(program: str, *arguments: object) -> None:
    """Run nodes/`program` without its output; raises CalledProcessError."""
    command = [sys.executable, str(ROOT / "nodes" / program), *map(str, arguments)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


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


cpu_seconds = partial(median_seconds, repeats=1, clock=time.process_time)
"""Returns the seconds of a core that a call takes."""


def say(words: str) -> None:
    """Tell beside the table what is done now, so that whoever waits knows for what."""
    print(f"{time.strftime('%H:%M:%S')} {words}", file=sys.stderr, flush=True)


def print_table(rows: List[Row]) -> None:
    """Print rows in columns under a heading."""
    lines = [("figure", "measured", "wanted"), *rows]
    widths = [max(len(line[column]) for line in lines) for column in range(3)]
    for index, line in enumerate(lines):
        print("  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip())
        if index == 0:
            print("  ".join("-" * width for width in widths))


def benchmark_parser(name: str, description: str) -> argparse.ArgumentParser:
    """Return a parser for `scripts/bench NAME`; description: the program's docstring."""
    return argparse.ArgumentParser(
        prog=f"scripts/bench {name}", description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
