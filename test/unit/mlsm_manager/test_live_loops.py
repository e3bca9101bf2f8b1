"""Loops that the live solver closes: when, how far, and what becomes of the path before and of the maps."""

import numpy as np
import pytest
from made_harbour import HARBOUR, SONAR_IN_BASE, tour
from made_loops import DEAF, astray, noisy, resumed
from made_models import solver_parameters
from scipy.spatial import cKDTree

from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.loops import Bend, Loop
from mlsm_manager.joint_solver.normal_equations import State
from mlsm_manager.joint_solver.places import PlaceCandidate
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.localisation.parameters import MlsmCoreParameters

pytestmark = pytest.mark.long

DRIFT = np.array([12.0, -6.0])
SCANS = 32


@pytest.fixture(scope="module")
def run():
    """The errors [m] of the newest place after each scan of a run that goes astray, and the loops it closed."""
    made = tour(SCANS)
    scans, _ = astray(made, DRIFT)
    solver, errors, closed = LiveSolver(solver_parameters(), RunLog(SONAR_IN_BASE)), [], {}
    for number, scan in enumerate(scans):
        newest = solver.add(scan)
        errors.append(np.hypot(*(newest.T_map_base - made.truth.at(newest.time))[:2]))
        if solver.closed:
            closed[number] = solver.closed
    return np.array(errors), closed


def test_the_live_solver_finds_a_place_again_some_scans_after_it_hears_it(run):
    errors, closed = run
    (scan,) = closed
    assert errors[scan - 1] > 10.0
    assert errors[scan:].max() < 1.0


def test_a_closed_loop_is_said_once_with_its_age_and_the_move(run):
    _, closed = run
    assert list(closed.values()) == ["found a place heard 336 s ago again: moved by 13.6 m"]


def assert_closes_none(solver, scans):
    for scan in scans:
        solver.add(scan)
        assert not solver.closed


@pytest.mark.parametrize("scans", [tour(SCANS).scans, noisy(tour(SCANS).scans)], ids=["not astray", "noise"])
def test_scans_of_a_run_that_is_not_astray_and_noise_close_no_loop(scans):
    assert_closes_none(LiveSolver(solver_parameters(), RunLog(SONAR_IN_BASE)), scans)


def test_a_resumed_run_closes_no_loop_since_the_map_stored_with_it_would_stay_behind():
    scans, _ = astray(tour(SCANS), DRIFT)
    assert_closes_none(resumed(scans[:20], solver_parameters()), scans[20:])


def bend_of(variances, older):
    """Return the bend of a path whose nodes have places with these variances [m^2], by 4 m along x."""
    place = PlaceCandidate(np.array([4.0, 0.0]), fit=0.9, fit_before=0.1, elsewhere=0.5, reach=5.0)
    start = State(np.zeros((len(variances), 3)), np.zeros(2))
    covariances = 0.5 * np.array(variances)[:, np.newaxis, np.newaxis] * np.eye(2)
    return Bend.of([Loop(len(variances), older - 1, place)], start, covariances)


@pytest.mark.parametrize(
    ("variances", "older", "moves"),
    [
        ([0.0, 1.0, 0.5, 1.0, 2.0], 2, [0, 0, 0, 4 / 3, 4]),
        ([0.0, 1.0, 1.0, 2.0, 2.0], 0, [0, 2, 2, 4, 4]),
        ([0.0, 1.0, 9.0, 1.0, 2.0], 0, [0, 2, 2, 2, 4]),
    ],
    ids=["not before the older visit", "where it became uncertain", "a branch with the place that it left"],
)
def test_the_path_bends_as_it_became_uncertain(variances, older, moves):
    np.testing.assert_allclose(bend_of(variances, older).state(1.0).nodes[:, 0], moves, atol=0.01)


def test_what_the_path_was_certain_of_is_dear_to_bend():
    assert bend_of([0.0, 0.1, 0.2], 0).cost(1.0) > 10.0 * bend_of([0.0, 10.0, 20.0], 0).cost(1.0)


def test_a_bend_takes_away_the_variance_that_it_explains():
    np.testing.assert_allclose(
        bend_of([1.0, 2.0, 3.0], 0).left(1.0, np.array([1.0, 2.0, 3.0])), [1, 0.75, 1 / 3], atol=0.01
    )


BLEND = 5.0  # s


@pytest.fixture(scope="module")
def mapped():
    """The localiser after a run astray with its updates and the corrections shown after each scan.

    Its odometry is not named: of a DVL, which drifts nine times less, the error would also be put down to the ranges.
    """
    localiser, updates, shown = MlsmCoreParameters(blend_time=BLEND).build_localiser(SONAR_IN_BASE), [], []
    scans, track = astray(tour(SCANS), DRIFT)
    for scan in scans:
        updates.append(localiser.take_scan(scan).scan)
        times = scan.reference_time + np.linspace(0.1, 13.0, 100)
        shown.append([localiser.following.correction(time, track.at(time)) for time in times])
    return localiser, updates, np.array(shown)


def closed_at(updates):
    (number,) = (number for number, update in enumerate(updates) if update.loop)
    return number


def test_the_map_is_drawn_anew_where_the_path_is_then(mapped):
    localiser, updates, _ = mapped
    assert closed_at(updates) > DEAF[-1]
    corners = np.vstack([HARBOUR, HARBOUR[:1]])
    walls = np.concatenate([np.linspace(*ends, 400) for ends in zip(corners[:-1], corners[1:])])
    distance, _ = cKDTree(walls).query(localiser.blocks.mean[:, :2])
    assert np.mean(distance < 1.0) > 0.97


def test_the_correction_goes_over_to_a_loop_and_never_jumps(mapped):
    _, updates, shown = mapped
    number = closed_at(updates)
    moved = np.hypot(*(shown[number, -1] - shown[number - 1, -1])[:2])
    steps = np.hypot(*np.diff(shown[number - 1 : number + 1].reshape(-1, 3), axis=0)[:, :2].T)
    assert moved > 3.0
    assert steps.max() < 2.0 * moved * (13.0 / 100) / BLEND + 1.0
