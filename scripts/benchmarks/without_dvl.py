"""Prints how far paths are from the truth where the vehicle has no DVL, on simulated tours.

One line per tour, odometry and seed: a compass alone, with and without changes of speed within a turn of the head, and
thrusters whose speed is right or 30 % wrong.
"""

from typing import Iterator, List, NamedTuple, Tuple

import numpy as np

from benchmarks.command_line import benchmark_parser
from benchmarks.heads import Simulated, recorded, simulated, tour_setup
from benchmarks.matching_scans import SonarKind
from benchmarks.solver_input import solver_input
from benchmarks.twins.odometry import reported
from benchmarks.twins.parameters import TwinParameters
from mlsm_manager.joint_solver.parameters import MultiViewParameters
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver
from mlsm_manager.joint_solver.solve.way_batch import solved_best
from mlsm_manager.localisation.odometry_choice import OdometryKind
from mlsm_manager.offline.echo_shape import EchoShape
from mlsm_manager.offline.recording import Recording
from mlsm_manager.scan_matching.scan import Scan, Track

TOURS = ("harbour_ahead_tour", "basin_ahead_tour", "harbour_tour", "basin_tour")
HEAD = SonarKind(500, 0.15, 0.3)  # the demo's
SCALES = (0.0, 0.3, -0.3)  # true speed over that of the commands, minus 1


class Figures(NamedTuple):
    """Errors [m] at the scans' ends. within: share of `live` within three told deviations. steps: of the batch fit."""

    live: float
    live_most: float
    batch: float
    batch_most: float
    within: float
    steps: int


def drawn(tour: Simulated, kind: OdometryKind, scale: float, seed: int) -> Recording:
    """Return the recording with what a compass, and thrusters with an error of `scale`, report."""
    errors = TwinParameters(direction=0.0, scale=scale, speed_deviation=0.02)
    made = reported(tour.truth, errors, np.random.RandomState(seed)).poses
    if kind is not OdometryKind.THRUSTERS:
        made = made * [0.0, 0.0, 1.0]
    return recorded(tour, Track(tour.truth.times, made))


def figures(scans: List[Scan], parameters: MultiViewParameters, sonar_in_base: np.ndarray, truth: Track) -> Figures:
    """Return how far the live and the batch path are from the truth, both beginning where it does."""
    solver = LiveSolver(parameters, sonar_in_base)
    for scan in scans:
        solver.add(scan)
    batch, times = solved_best(solver), solver.log.node_times[1:]
    true = (truth.at(times) - truth.at(solver.log.node_times[0]))[:, :2]
    live = np.array([estimate.T_map_base[:2] for estimate in solver.estimates])
    told = np.array([np.sqrt(np.trace(estimate.pose_covariance[:2, :2])) for estimate in solver.estimates])
    fitted = (solver.log.node_poses(np.arange(len(times) + 1)) + batch.state.nodes[:, :3])[:, :2]
    start = solver.log.node_poses(np.array([0]))[0, :2]
    known, smooth = (np.hypot(*(path - start - true).T) for path in (live, fitted[1:]))
    return Figures(known.mean(), known.max(), smooth.mean(), smooth.max(), (known < 3.0 * told).mean(), batch.steps)


def _cases() -> Iterator[Tuple[OdometryKind, float]]:
    yield OdometryKind.HEADING, 0.0
    yield OdometryKind.HOVERING, 0.0
    for scale in SCALES:
        yield OdometryKind.THRUSTERS, scale


def main() -> None:
    """Print one line per tour, odometry and seed."""
    parser = benchmark_parser("without_dvl", __doc__)
    parser.add_argument("--tours", nargs="+", default=TOURS, choices=TOURS, help="which ones; default: all")
    parser.add_argument("--seeds", type=int, default=1, help="compasses with each tour (default: %(default)s)")
    arguments = parser.parse_args()
    for name in arguments.tours:
        tour = simulated(tour_setup(*name.split("_", 1), HEAD))
        for kind, scale in _cases():
            for seed in range(arguments.seeds):
                recording = drawn(tour, kind, scale, seed)
                found = figures(*solver_input(recording, kind, EchoShape.PEAK), recording.sonar_in_base, tour.truth)
                what = kind.value.lower() + (f", true speed {1.0 + scale:g} of it" if scale else "")
                print(f"{name}, {what}, seed {seed}: {_line(found)}", flush=True)


def _line(found: Figures) -> str:
    return (
        f"corrected {found.live:.2f} m in the mean, {found.live_most:.2f} m at most, within three told deviations "
        f"{100.0 * found.within:.0f} %; refined {found.batch:.2f}, {found.batch_most:.2f} m in {found.steps} steps"
    )


if __name__ == "__main__":
    main()
