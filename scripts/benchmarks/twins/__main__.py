"""Prints how far live and batch paths are from the truth on twins of a recorded run."""

from pathlib import Path
from typing import Tuple

from benchmarks.command_line import benchmark_parser
from benchmarks.path_figures import PathFigures, figures_of
from benchmarks.solver_input import solver_input
from benchmarks.twins.parameters import TWINS
from benchmarks.twins.recording import twin_of
from mlsm_manager.joint_solver.solve.batch_solver import solved
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver
from mlsm_manager.localisation.odometry_choice import OdometryKind
from mlsm_manager.offline.bag_recording import read_recording
from mlsm_manager.offline.echo_shape import echo_shape_of
from mlsm_manager.offline.evaluation import positions_at
from mlsm_manager.offline.recording import Recording
from recordings.reader import Request


def main() -> None:
    """Print one line per twin."""
    parser = benchmark_parser("twins", __doc__)
    parser.add_argument("bag", type=Path, help="recording whose path and timing the twins have")
    parser.add_argument("twins", nargs="*", default=list(TWINS), help="which ones; default: " + ", ".join(TWINS))
    arguments = parser.parse_args()
    source = read_recording(arguments.bag, Request())
    for name in arguments.twins:
        for path, found in zip(("live", "batch"), figures(twin_of(source, TWINS[name]))):
            print(f"{name}, {path}: {found.line()}", flush=True)


def figures(twin: Recording) -> Tuple[PathFigures, PathFigures]:
    """Return how far the live and the batch path are from the truth."""
    scans, parameters = solver_input(twin, OdometryKind.DVL, echo_shape_of([placed.beam for placed in twin.beams]))
    solver = LiveSolver(parameters, twin.sonar_in_base)
    for scan in scans:
        solver.add(scan)
    truth = positions_at(twin.truth.times, twin.truth.positions, solver.log.node_times)
    return figures_of(solver, solved(solver), truth)


if __name__ == "__main__":
    main()
