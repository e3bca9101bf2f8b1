"""What a scan costs the localiser, map included, after 100 scans and after many, on a tour that never ends."""

import os
import sys
import time
from typing import Iterator

import numpy as np
from soaking.processes import held

from benchmarks.harness import ROOT
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.localisation.parameters import LocaliserParameters
from mlsm_manager.offline.replay import ReplayParameters
from mlsm_manager.scan_matching.scan import Scan, Track
from node_support.geometry import inverse, rotated, transformed

sys.path += [str(ROOT / "test/unit"), str(ROOT / "test/unit/mlsm_manager")]
from made_harbour import weaving
from made_recordings import ranges_along

_BEAMS, _TURN = 60, 14.0  # of the head, s
_MEASURED_AT = (100, 300, 1000, 3000, 10_000)
_AVERAGED = 50  # scans
_ODOMETRY_STEP, _AFTER = 0.5, 2.0  # s
_NOISE, _DRIFT = 0.1, 0.02  # m, rad
_QUAYS = np.array([[-28.0, -18.0], [30.0, -18.0], [30.0, 20.0], [-28.0, 20.0]])  # m: corners of the harbour


class _Live(ReplayParameters):
    """Those of a replay, but for a run that never ends."""

    def solver_parameters(self) -> SolverParameters:
        return LocaliserParameters.solver_parameters(self)


def _odometry(times: np.ndarray) -> np.ndarray:
    """Return the poses (n, 3) by an odometry that goes a little beside the true direction."""
    poses = weaving(times)
    return np.column_stack([rotated(poses[:, :2], np.full(len(times), _DRIFT)), poses[:, 2]])


def _scan(number: int, rng: np.random.RandomState) -> Scan:
    """Return a scan of a rectangular harbour."""
    stamps = (number + (np.arange(_BEAMS) + 1.0) / _BEAMS) * _TURN
    bearings = np.arange(_BEAMS) * 2.0 * np.pi / _BEAMS
    poses = weaving(stamps)
    ranges = ranges_along(poses[:, :2], bearings + poses[:, 2], _QUAYS) + rng.normal(0.0, _NOISE, _BEAMS)
    seen = ranges[:, np.newaxis] * np.column_stack([np.cos(bearings), np.sin(bearings)])
    times = np.arange(stamps[0] - 2.0 * _TURN, stamps[-1] + _AFTER, _ODOMETRY_STEP)
    points = np.column_stack([transformed(_odometry(stamps), seen), np.zeros(_BEAMS), np.full(_BEAMS, 100.0)])
    return Scan(points, stamps, np.ones(_BEAMS, dtype=bool), Track(times, _odometry(times)), float(stamps[-1]))


def lines(scans: int = 10_000) -> Iterator[str]:
    """Yield time per scan, memory and error each time some number of scans is reached; all take ten minutes."""
    localiser, seconds, rng = _Live().build_localiser(np.zeros(2)), [], np.random.RandomState(0)
    start = np.zeros(1)
    for number in range(1, scans + 1):
        scan, begin = _scan(number - 1, rng), time.process_time()
        belief = localiser.take_scan(scan).scan.belief
        seconds.append(time.process_time() - begin)
        if number in _MEASURED_AT or number == scans:
            spent, most = (1e3 * float(statistic(seconds[-_AVERAGED:])) for statistic in (np.median, np.max))
            # The map begins at the odometry's start.
            truth = transformed(inverse(weaving(start))[0], weaving(np.array([number * _TURN]))[:, :2])
            found = transformed(inverse(_odometry(start))[0], belief.theta[np.newaxis, :2])
            yield (
                f"{number} scans: {spent:.0f} ms a scan, {most:.0f} ms at most, {held(os.getpid()).memory:.0f} MB, "
                f"{np.hypot(*(found - truth)[0]):.2f} m from the truth"
            )
