"""Prints what a scan costs the localiser, map included, after 100 scans and after many, on a tour that never ends."""

import os
import sys
import time
from typing import Iterator

import numpy as np
from soaking.processes import held

from benchmarks.harness import ROOT, benchmark_parser
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.localisation.parameters import LocaliserParameters
from mlsm_manager.offline.replay import ReplayParameters
from mlsm_manager.scan_matching.scan import Scan, Track
from node_support.geometry import inverse, rotated, transformed

sys.path += [str(ROOT / "test/unit"), str(ROOT / "test/unit/mlsm_manager")]
from made_harbour import weaving
from made_recordings import ranges_along

SCANS = 10_000
BEAMS = 60
_TURN = 14.0
_MEASURED_AT = (100, 300, 1000, 3000, 10_000)
_AVERAGED = 50
_ODOMETRY_STEP = 0.5
_AFTER = 2.0
_NOISE = 0.1
_DRIFT = 0.02
_QUAYS = np.array([[-28.0, -18.0], [30.0, -18.0], [30.0, 20.0], [-28.0, 20.0]])  # m: corners of the harbour


class _Live(ReplayParameters):
    """Those of a replay, but for a run that never ends."""

    def solver_parameters(self) -> SolverParameters:
        return LocaliserParameters.solver_parameters(self)


def odometry_path(times: np.ndarray) -> np.ndarray:
    """Return the poses (n, 3) by an odometry that goes a little beside the true direction."""
    poses = weaving(times)
    return np.column_stack([rotated(poses[:, :2], np.full(len(times), _DRIFT)), poses[:, 2]])


def tour_scans(count: int) -> Iterator[Scan]:
    """Yield scans of a rectangular harbour, oldest first."""
    rng = np.random.RandomState(0)
    for number in range(count):
        yield _scan(number, rng)


def _scan(number: int, rng: np.random.RandomState) -> Scan:
    stamps = (number + (np.arange(BEAMS) + 1.0) / BEAMS) * _TURN
    bearings = np.arange(BEAMS) * 2.0 * np.pi / BEAMS
    poses = weaving(stamps)
    ranges = ranges_along(poses[:, :2], bearings + poses[:, 2], _QUAYS) + rng.normal(0.0, _NOISE, BEAMS)
    seen = ranges[:, np.newaxis] * np.column_stack([np.cos(bearings), np.sin(bearings)])
    track_times = np.arange(stamps[0] - 2.0 * _TURN, stamps[-1] + _AFTER, _ODOMETRY_STEP)
    points = np.column_stack([transformed(odometry_path(stamps), seen), np.zeros(BEAMS), np.full(BEAMS, 100.0)])
    track = Track(track_times, odometry_path(track_times))
    return Scan(points, stamps, np.ones(BEAMS, dtype=bool), track, float(stamps[-1]))


def main() -> None:
    """Print time per scan, memory and error each time a number of scans is reached."""
    parser = benchmark_parser("long_run", __doc__)
    parser.add_argument("scans", type=int, nargs="?", default=SCANS, help="default: %(default)s, about ten minutes")
    scans = parser.parse_args().scans
    localiser, seconds = _Live().build_localiser(np.zeros(2)), []
    for number, scan in enumerate(tour_scans(scans), start=1):
        start = time.process_time()
        belief = localiser.take_scan(scan).scan.belief
        seconds.append(time.process_time() - start)
        if number in _MEASURED_AT or number == scans:
            spent, most = (1e3 * float(statistic(seconds[-_AVERAGED:])) for statistic in (np.median, np.max))
            error = position_error(number, belief.theta[:3])
            memory = held(os.getpid()).memory
            print(
                f"{number} scans: {spent:.0f} ms a scan, {most:.0f} ms at most, {memory:.0f} MB, {error:.2f} m from "
                "the truth", flush=True,
            )  # fmt: skip


def position_error(number: int, T_map_base: np.ndarray) -> float:
    """Return how far [m] a pose (3,) is from the truth after so many scans; the map begins at the odometry's start."""
    start, end = np.zeros(1), np.array([number * _TURN])
    truth = transformed(inverse(weaving(start))[0], weaving(end)[:, :2])
    found = transformed(inverse(odometry_path(start))[0], T_map_base[np.newaxis, :2])
    return float(np.hypot(*(found - truth)[0]))
