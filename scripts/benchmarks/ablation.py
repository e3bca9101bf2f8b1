"""Prints what each ingredient of the joint solver buys: the same runs with one of them left out at a time.

The runs are twins of a recording (benchmarks.twins) and simulated tours (benchmarks.heads), whose truth is known.
"""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Callable, Dict, List, NamedTuple

import numpy as np

from benchmarks.command_line import benchmark_parser
from benchmarks.heads import recordings, tour_setup
from benchmarks.matching_scans import KINDS
from benchmarks.path_figures import figures_of
from benchmarks.solver_input import solver_input
from benchmarks.twins.parameters import TWINS
from benchmarks.twins.recording import twin_of
from mlsm_manager.joint_solver.motion.dvl_factors import DvlFactors
from mlsm_manager.joint_solver.motion.odometry_parameters import DvlOdometry
from mlsm_manager.joint_solver.parameters import MultiViewParameters
from mlsm_manager.joint_solver.solve.batch_solver import solved
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver
from mlsm_manager.localisation.odometry_choice import OdometryKind
from mlsm_manager.offline.bag_recording import read_recording
from mlsm_manager.offline.echo_shape import EchoShape, echo_shape_of
from mlsm_manager.offline.evaluation import positions_at
from mlsm_manager.offline.recording import Recording
from mlsm_manager.scan_matching.scan import Scan
from recordings.reader import Request

Change = Callable[[MultiViewParameters], MultiViewParameters]
TOURS = ("basin", "harbour")
_SURE = 1e-5  # a deviation so small that what it is of stays as expected


class Run(NamedTuple):
    """truth: (n + 1, 2) m at the nodes of n scans."""

    scans: List[Scan]
    parameters: MultiViewParameters
    sonar_in_base: np.ndarray
    truth: np.ndarray


def _with(part: str, **values: Any) -> Change:
    """Return what changes values of one group of the parameters."""
    return lambda parameters: replace(parameters, **{part: replace(getattr(parameters, part), **values)})


def _with_odometry(**values: float) -> Change:
    return lambda parameters: replace(parameters, odometry=DvlFactors(DvlOdometry(**values)))


VARIANTS: Dict[str, Change] = {
    "as it is": lambda parameters: parameters,
    "a point is as sure across the beam as along it": _with("matching", beam_half_width=0.0),
    "both sides of a wall are one": _with("matching", min_cosine=-1.0),
    "comparisons count as independent": _with("matching", weight=1.0),
    "new scans are compared no farther than others": _with("matching", wide_cut=2.2),
    "scans are searched one by one": _with("matching", block_scans=1),
    "lone echoes are compared": _with("matching", lone_quality=1.0),
    "straight walls tell nothing of the way along them": _with("matching", normal_deviation=0.2),
    "20 newest scans are free": _with("window", free_nodes=20),
    "10 newest scans are free": _with("window", free_nodes=10),
    "5 newest scans are free": _with("window", free_nodes=5),
    "two steps per scan": _with("window", live_iterations=2),
    "one step per scan": _with("window", live_iterations=1),
    "ranges are taken as they are": _with("sonar", range_scale_deviation=_SURE),
    "stamps are taken as they are": _with("sonar", sonar_delay_deviation=_SURE),
    "the odometry's direction is taken as it is": _with_odometry(direction_deviation=0.0, direction_walk=0.0),
    "the odometry's scale is taken as it is": _with_odometry(scale_deviation=0.0),
}


def run_of(recording: Recording, truth: Callable[[np.ndarray], np.ndarray], shape: EchoShape) -> Run:
    """Return a run; truth: takes times (n,) [s] and returns places (n, 2) [m]."""
    scans, parameters = solver_input(recording, OdometryKind.DVL, shape)
    solver = LiveSolver(parameters, recording.sonar_in_base)
    for scan in scans:
        solver.add(scan)
    return Run(scans, parameters, recording.sonar_in_base, truth(solver.log.node_times))


def twin_run(source: Recording, name: str) -> Run:
    """Return the run of a twin."""
    twin = twin_of(source, TWINS[name])
    shape = echo_shape_of([placed.beam for placed in twin.beams])
    return run_of(twin, lambda times: positions_at(twin.truth.times, twin.truth.positions, times), shape)


def tour_run(world: str) -> Run:
    """Return the run of a simulated tour with the demo's head."""
    recording, path = recordings(tour_setup(world, "tour", KINDS[0]), 1)[0]
    return run_of(recording, lambda times: path.at(times)[:, :2], EchoShape.PEAK)


def line(run: Run, change: Change) -> str:
    """Return the figures of one variant as text."""
    start = time.process_time()
    solver = LiveSolver(change(run.parameters), run.sonar_in_base)
    for scan in run.scans:
        solver.add(scan)
    batch = solved(solver)
    seconds = time.process_time() - start
    figures = figures_of(solver, batch, run.truth)
    parts = (
        f"{name} {one.mean:.2f} / {one.most:.2f} m, NEES {one.nees:.2f}"
        for name, one in zip(("live", "refined"), figures)
    )
    return f"{', '.join(parts)}, {seconds:.1f} s"


def main() -> None:
    """Print one line per run and variant: mean / greatest distance from the truth, NEES per state, computing time."""
    parser = benchmark_parser("ablation", __doc__)
    parser.add_argument("bag", type=Path, help="recording whose path and timing the twins have")
    parser.add_argument(
        "--runs", nargs="+", default=["as_recorded", "reversed", "graded", *TOURS], choices=[*TWINS, *TOURS]
    )
    parser.add_argument("--only", nargs="+", default=list(VARIANTS), choices=list(VARIANTS), metavar="VARIANT")
    arguments = parser.parse_args()
    source = read_recording(arguments.bag, Request())
    for name in arguments.runs:
        run = tour_run(name) if name in TOURS else twin_run(source, name)
        for variant in arguments.only:
            print(f"{name}, {variant}: {line(run, VARIANTS[variant])}", flush=True)


if __name__ == "__main__":
    main()
