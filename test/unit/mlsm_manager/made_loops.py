"""Runs whose odometry goes astray while nothing is heard, and that come back to places heard before."""

import numpy as np
from made_harbour import deaf, logged, placed_by, that_heard
from made_models import followed

from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.scan_matching.scan import Track

DEAF = range(15, 25)  # scans that hear nothing, while the odometry goes astray


def astray(made, drift):
    """Return the scans of a tour, and its odometry, which drifts by `drift` (2,) [m] while nothing is heard."""
    start, end = (made.scans[number].reference_time for number in (DEAF[0], DEAF[-1]))
    share = np.clip((made.odometry.times - start) / (end - start), 0.0, 1.0)[:, np.newaxis]
    track = Track(made.odometry.times, made.odometry.poses + share * np.append(drift, 0.0))
    return deaf([placed_by(scan, track) for scan in made.scans], DEAF), track


def noisy(scans):
    """Return scans that heard echoes anywhere within 30 m instead."""
    rng = np.random.RandomState(0)
    around = ((scan, rng.uniform(-30.0, 30.0, (len(scan), 2))) for scan in scans)
    return [that_heard(scan, scan.track, scan.track.at(scan.times)[:, :2] + places) for scan, places in around]


def resumed(scans, parameters):
    """Return a live solver after `scans` that was stored and resumed, which therefore closes no loop itself."""
    return LiveSolver.resumed(parameters, logged(scans), followed(scans, parameters).stored())
