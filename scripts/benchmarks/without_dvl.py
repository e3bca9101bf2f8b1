"""Prints how far paths are from the truth where the vehicle has no DVL, on simulated tours.

Two lines per tour, odometry and seed: a compass alone, with and without changes of speed within a turn of the head,
and thrusters whose speed is right or 30 % wrong.
"""

import numpy as np

from benchmarks.harness import benchmark_parser
from benchmarks.paths import batch_figures, live_figures, solved_live
from benchmarks.tours import Tour, simulated
from benchmarks.twin_conditions import TwinParameters, reported
from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.suited_parameters import EchoShape
from mlsm_manager.scan_matching.scan import Track

TOURS = ("harbour_ahead_tour", "basin_ahead_tour", "harbour_tour", "basin_tour")
CASES = (
    (OdometryKind.HEADING, 0.0),
    (OdometryKind.HOVERING, 0.0),
    *((OdometryKind.THRUSTERS, s) for s in (0, 0.3, -0.3)),
)
"""Odometry, and the true speed over that of the commands, minus 1."""


def drawn(tour: Tour, kind: OdometryKind, scale: float, seed: int) -> Recording:
    """Return the recording with what a compass, and thrusters with an error of `scale`, report."""
    errors = TwinParameters(direction=0.0, scale=scale, speed_deviation=0.02)
    made = reported(tour.truth, errors, np.random.RandomState(seed)).poses
    if kind is not OdometryKind.THRUSTERS:
        made = made * [0.0, 0.0, 1.0]
    return tour.recording(Track(tour.truth.times, made))


def main() -> None:
    """Print two lines per tour, odometry and seed."""
    parser = benchmark_parser("without_dvl", __doc__)
    parser.add_argument("--tours", nargs="+", default=TOURS, choices=TOURS, help="which ones; default: all")
    parser.add_argument("--seeds", type=int, default=1, help="compasses with each tour (default: %(default)s)")
    arguments = parser.parse_args()
    for name in arguments.tours:
        tour = simulated(name)
        for kind, scale in CASES:
            for seed in range(arguments.seeds):
                solver = solved_live(drawn(tour, kind, scale, seed), kind, EchoShape.PEAK)
                what = kind.value.lower() + (f", true speed {1.0 + scale:g} of it" if scale else "")
                print(
                    f"{name}, {what}, seed {seed}, corrected: {live_figures(solver, tour.truth.at).line()}", flush=True
                )
                found, batch = batch_figures(solver, tour.truth.at)
                print(f"{name}, {what}, seed {seed}, refined in {batch.steps} steps: {found.line()}", flush=True)


if __name__ == "__main__":
    main()
