"""The joint solver on the whole marina, whose truth is kept aside: nothing may hang on one bit."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from benchmarks.fault_makers import range_told
from benchmarks.faults import ending
from benchmarks.harness import mapped_as

from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.offline.recording import read_recording, scans_of
from mlsm_manager.offline.replay import ReplayParameters
from recordings.reader import Request
from sonar_processing.filters.echo_extractor import EchoExtractor

# Longer than the solver's window, so that frozen scans take part.
_SCANS = 60


@pytest.fixture(scope="module")
def whole(recording):
    return read_recording(recording("marina_whole_blind.bag"), Request())


@pytest.fixture(scope="module")
def recorded(whole):
    parameters = ReplayParameters(odometry=OdometryKind.DVL)
    scans = [scan for scan, _ in islice(scans_of(whole, EchoExtractor(parameters.echoes())), _SCANS)]
    return whole, parameters, scans


@pytest.fixture(scope="module")
def canal(whole):
    return ending(whole, 600.0)


def path_of(recording, parameters, scans):
    solver = LiveSolver(parameters.solver_parameters(), RunLog(recording.sonar_in_base))
    for scan in scans:
        solver.add(scan)
    return np.array([estimate.T_map_base for estimate in solver.estimates])


def test_points_moved_by_a_nanometre_move_the_path_by_less_than_a_hundredth_of_a_millimetre(recorded):
    recording, parameters, scans = recorded
    rng = np.random.RandomState(1)
    moved = [replace(scan, points=scan.points + 1e-9 * rng.standard_normal(scan.points.shape)) for scan in scans]
    distance = path_of(recording, parameters, moved) - path_of(*recorded)
    assert 0.0 < np.abs(distance[:, :2]).max() < 1e-5


def test_positions_are_believed_in_a_canal_though_scans_of_a_shorter_path_lie_on_each_other_more(canal):
    short_at_first = range_told(canal, at=0.0, share=0.4, seconds=300.0)
    assert mapped_as(short_at_first, "--refine").odometry.kind is OdometryKind.AUTO


def test_a_canal_shows_no_iron_beside_a_compass_alone_that_errs_as_usual(canal):
    found = mapped_as(canal.without_positions(), "--refine", "--odometry", "heading")
    assert found.findings.trust.causes == []
