"""Runs whose odometry goes astray while nothing is heard, and that come back to places heard before."""

from dataclasses import replace

import numpy as np
from made_harbour import logged, selected, that_heard
from made_models import followed

from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import inverse, transformed

DEAF = range(15, 25)  # scans that hear nothing, while the odometry goes astray


def astray(made, drift):
    """Return the scans of a tour, and its odometry, which drifts by `drift` (2,) [m] while nothing is heard."""
    start, end = (made.scans[number].reference_time for number in (DEAF[0], DEAF[-1]))
    share = np.clip((made.odometry.times - start) / (end - start), 0.0, 1.0)[:, np.newaxis]
    track = Track(made.odometry.times, made.odometry.poses + share * np.append(drift, 0.0))
    return [_heard_by(scan, number, track) for number, scan in enumerate(made.scans)], track


def _heard_by(scan, number, track):
    points = transformed(track.at(scan.times), transformed(inverse(scan.track.at(scan.times)), scan.points))
    return selected(replace(scan, points=points, track=track), np.full(len(points), number not in DEAF))


def noisy(scans):
    """Return scans that heard echoes anywhere within 30 m instead."""
    rng = np.random.RandomState(0)
    around = ((scan, rng.uniform(-30.0, 30.0, (len(scan), 2))) for scan in scans)
    return [that_heard(scan, scan.track, scan.track.at(scan.times)[:, :2] + places) for scan, places in around]


def resumed(scans, parameters):
    """Return a live solver after `scans` that was stored and resumed, which therefore closes no loop itself."""
    return LiveSolver.resumed(parameters, logged(scans), followed(scans, parameters).stored())
