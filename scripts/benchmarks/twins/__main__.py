"""Prints how far live and batch paths are from the truth on twins of a recorded run.

PYTHONPATH=scripts:$PYTHONPATH python3 -m benchmarks.twins RUN.bag [TWIN ...]
"""

import argparse
from pathlib import Path
from typing import Tuple

import numpy as np

from benchmarks.path_figures import PathFigures, figures_of
from benchmarks.twins.parameters import TWINS, TwinParameters
from benchmarks.twins.recording import twin_of
from mlsm_manager.multi_view.batch_solver import solved
from mlsm_manager.multi_view.live_solver import LiveSolver
from mlsm_manager.multi_view.parameters import MultiViewParameters
from mlsm_manager.offline.bag_recording import read_recording
from mlsm_manager.offline.evaluation import positions_at
from mlsm_manager.offline.recording import Recording, scans_of
from node_support.geometry.planar import inverse, transformed
from recordings.reading.reader import Request
from sonar_processing.filters.echo_extraction import EchoExtractorParameters, ExtractionMode


def main() -> None:
    """Print one line per twin."""
    parser = argparse.ArgumentParser(prog="benchmarks.twins", description=__doc__)
    parser.add_argument("bag", type=Path, help="recording whose path and timing the twins have")
    parser.add_argument("twins", nargs="*", default=list(TWINS), help="which ones; default: " + ", ".join(TWINS))
    arguments = parser.parse_args()
    source = read_recording(arguments.bag, Request())
    for name in arguments.twins:
        for path, found in zip(("live", "batch"), figures(twin_of(source, TWINS[name]), TWINS[name])):
            print(f"{name}, {path}: {found.line()}", flush=True)


def figures(twin: Recording, conditions: TwinParameters) -> Tuple[PathFigures, PathFigures]:
    """Return how far the live and the batch path are from the truth."""
    mode = ExtractionMode.DENSE if conditions.binary else ExtractionMode.MATCHED_FILTER
    solver = LiveSolver(MultiViewParameters(), sonar_in_base(twin))
    for scan, _ in scans_of(twin, EchoExtractorParameters(mode=mode, spacing=1.0)):
        solver.add(scan)
    truth = positions_at(twin.truth.times, twin.truth.positions, solver.log.node_times)
    return figures_of(solver, solved(solver), truth)


def sonar_in_base(recording: Recording) -> np.ndarray:
    """Return where the sonar is in base_link (2,) [m]."""
    first = recording.beams[0]
    T_odom_base = recording.track.at(np.array([first.beam.stamp_ns * 1e-9]))
    return transformed(inverse(T_odom_base), first.T_target_sonar[:2, 3][np.newaxis])[0]


if __name__ == "__main__":
    main()
