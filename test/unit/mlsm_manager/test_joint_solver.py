"""The joint solver, live and batch, on a simulated tour."""

from dataclasses import replace

import numpy as np
import pytest
from made_harbour import TURN, deaf, tour, with_wild_odometry
from made_models import DVL_ODOMETRY, errors_of, followed, solver_parameters

from mlsm_manager.joint_solver.batch_solver import fit_of
from mlsm_manager.joint_solver.live_solver import followed_anew
from mlsm_manager.joint_solver.motion_models import DIRECTION
from mlsm_manager.joint_solver.normal_equations import DELAY
from mlsm_manager.joint_solver.position_models import DvlFactors
from node_support.errors import RefusedInput

DIRECTION_ERROR, LATE = 0.12, 0.6
DEFAULTS = solver_parameters(sonar_delay_deviation=1.0)


@pytest.fixture(scope="module")
def made():
    return tour(24, direction=DIRECTION_ERROR, delay=LATE)


@pytest.fixture(scope="module")
def live(made):
    return followed(made.scans)


@pytest.fixture(scope="module")
def batch(live):
    return fit_of(live.solution)


def test_live_follows_a_vehicle_whose_odometry_goes_astray(made, live):
    astray = np.hypot(*(made.odometry.poses - made.truth.poses)[:, :2].T)
    assert astray.max() > 2.0
    assert np.hypot(*errors_of(live, made)[-10:, :2].T).max() < 0.4


def test_direction_and_delay_are_found(live, batch):
    assert live.estimates[-1].node[DIRECTION] == pytest.approx(DIRECTION_ERROR, abs=0.03)
    assert live.estimates[-1].run[DELAY] == pytest.approx(LATE, abs=0.2)
    assert batch.state.run[DELAY] == pytest.approx(LATE, abs=0.2)


def test_batch_is_closer_to_the_truth_than_live(made, live, batch):
    fitted = live.solution.with_state(batch.state).path(batch.node_times[1:]) - made.truth.at(batch.node_times[1:])
    fitted, of_live = (np.hypot(*(error - error[0])[:, :2].T).mean() for error in (fitted, errors_of(live, made)))
    assert fitted < min(0.3, of_live)


def test_told_deviations_cover_the_errors_and_are_not_idle(made, live):
    error = errors_of(live, made)[:, :2]
    covariances = np.array([estimate.pose_covariance[:2, :2] for estimate in live.estimates])
    nees = np.einsum("na,nab,nb->n", error, np.linalg.inv(covariances), error)
    assert 0.01 < nees.mean() / 2.0 < 2.0


def test_the_frozen_map_s_own_error_counts_in_the_place_and_in_the_calibration(made):
    newest = followed(made.scans, replace(DEFAULTS, free_scans=6)).estimates[-1]
    assert np.trace(newest.covariance[:2, :2]) > np.trace(newest.own_covariance[:2, :2])
    assert (newest.deviations[-2:] > 1.001 * np.sqrt(np.diag(newest.own_covariance)[-2:])).all()


def test_a_delay_that_an_earlier_mission_was_too_sure_of_is_found_all_the_same(made):
    wrong = solver_parameters(sonar_delay=LATE - 1.0, sonar_delay_deviation=0.1, free_scans=4)
    solver = followed(made.scans, wrong)
    assert solver.estimates[-1].run[DELAY] == pytest.approx(LATE, abs=0.3)


def test_the_same_scans_give_the_same_bytes(made, live, batch):
    again = followed(made.scans)
    assert again.state.nodes.tobytes() == live.state.nodes.tobytes()
    assert fit_of(again.solution).state.nodes.tobytes() == batch.state.nodes.tobytes()


def test_a_run_that_is_followed_anew_goes_where_it_went(live):
    astray = live.state.copy()
    astray.nodes[9:, :2] += 10.0
    anew = live.solution.with_state(followed_anew(live.solution.with_state(astray), 8))
    np.testing.assert_allclose(anew.places, live.solution.places, atol=0.2)


def test_a_scan_that_is_not_newer_is_refused_and_changes_nothing(made):
    solver = followed(made.scans[:3])
    before = solver.state.nodes.copy()
    with pytest.raises(RefusedInput, match="the one before"):
        solver.add(made.scans[1])
    np.testing.assert_array_equal(solver.state.nodes, before)


@pytest.mark.parametrize("scans", [0, 6])
def test_a_scan_without_a_solution_is_refused_and_changes_nothing(made, scans):
    solver, undisturbed = followed(made.scans[:scans]), followed(made.scans[: scans + 2])
    with pytest.raises(RefusedInput, match="ends at"):
        solver.add(with_wild_odometry(made.scans[scans]))
    for scan in made.scans[scans : scans + 2]:
        found, expected = solver.add(scan), undisturbed.estimates[-1]
    np.testing.assert_allclose(solver.state.nodes, undisturbed.state.nodes, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=0.0, atol=1e-9)


def test_the_second_scan_is_compared_with_the_first(live):
    assert [estimate.comparisons > 0 for estimate in live.estimates[:3]] == [False, True, True]


def test_scans_without_echoes_are_bridged_by_the_odometry(made):
    solver = followed(deaf(made.scans, range(8, 14)))
    assert np.hypot(*errors_of(solver, made)[-1, :2]) < 0.6
    assert solver.estimates[13].pose_covariance[0, 0] > solver.estimates[7].pose_covariance[0, 0]


def test_a_run_that_begins_deaf_starts_at_the_odometry(made):
    estimate = followed([made.scans[0].without_points(TURN)]).estimates[-1]
    np.testing.assert_allclose(estimate.T_map_base, estimate.T_odom_base, atol=1e-9)
    assert estimate.comparisons == 0


def test_scans_agree_with_the_map_they_made_and_not_with_another(made, live):
    assert min(estimate.agreement for estimate in live.estimates[5:]) > 0.8
    scan = made.scans[10]
    strange = replace(scan, points=scan.points + np.array([1.9, 1.9, 0.0, 0.0]))
    sure = DvlFactors(replace(DVL_ODOMETRY, position_walk=0.001, direction_deviation=0.001))
    solver = followed(tour(10).scans, replace(DEFAULTS, odometry=sure))
    assert solver.add(strange).agreement < 0.5
