"""Prints how far the joint solver's paths are from the truth, and how honest it is, with heads of different sharpness.

Each tour is simulated once per head. Its odometry is then drawn N times, with errors as those of a DVL and a compass.
"""

from typing import Tuple

import numpy as np

from benchmarks.harness import benchmark_parser
from benchmarks.paths import PathFigures, batch_figures, live_figures, solved_live
from benchmarks.scans import KINDS
from benchmarks.tours import Tour, simulated
from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.offline.suited_parameters import EchoShape


def mean_figures(tour: Tour, draws: int) -> Tuple[PathFigures, PathFigures]:
    """Return the means of the live and of the batch figures over as many odometries."""
    found = []
    for seed in range(draws):
        solver = solved_live(tour.with_dvl(seed), OdometryKind.DVL, EchoShape.PEAK)
        found.append((live_figures(solver, tour.truth.at), batch_figures(solver, tour.truth.at)[0]))
    live, batch = np.mean(found, axis=0)
    return PathFigures(*live), PathFigures(*batch)


def main() -> None:
    """Print two lines per world and head."""
    parser = benchmark_parser("heads", __doc__)
    parser.add_argument("--worlds", nargs="+", default=["basin", "harbour"], choices=["basin", "harbour"])
    parser.add_argument("--draws", type=int, default=4, help="odometries per tour (default: %(default)s)")
    arguments = parser.parse_args()
    for world in arguments.worlds:
        for kind in KINDS:
            for name, found in zip(("live", "batch"), mean_figures(simulated(f"{world}_tour", kind), arguments.draws)):
                print(f"{world}, {kind}, {name}: {found.line()}", flush=True)


if __name__ == "__main__":
    main()
