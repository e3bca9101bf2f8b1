"""A vehicle that knows its heading only, and that stops, starts and goes sideways."""

import numpy as np
import pytest
from made_harbour import SONAR_IN_BASE, TURN, logged, tour
from made_models import errors_of, followed

from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.localisation.odometry_profiles import OdometryKind, fitted, profile_values, strafes
from mlsm_manager.localisation.parameters import EstimatorName, MlsmCoreParameters
from mlsm_manager.offline.suited_parameters import goes_on
from mlsm_manager.self_check.verdict import Answer
from node_support.errors import RefusedInput

pytestmark = pytest.mark.long

PARTS = profile_values(OdometryKind.HOVERING)["parts_per_turn"]
STOPS = np.array([[0.0, 0.0], [6.0, 7.0], [-8.0, 6.0], [-12.0, -6.0], [2.0, -8.0]])
GOING, RESTING = 28.0, 10.0  # s


def strafed(times):
    """Return poses (m, 3): from stop to stop along straight lines at up to 1 m/s, and always looking ahead."""
    moves, into = np.divmod(np.asarray(times, dtype=float), GOING + RESTING)
    share = np.clip(into / GOING, 0.0, 1.0)
    share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    first, last = (STOPS[(moves.astype(int) + further) % len(STOPS)] for further in (0, 1))
    places = first + share[:, np.newaxis] * (last - first)
    return np.column_stack([places, 0.1 * np.sin(np.asarray(times) / 20.0)])


MADE = tour(14, path=strafed)


def solver_of(kind, scans=MADE.scans):
    profile = MlsmCoreParameters(estimator=EstimatorName.JOINT).changed(profile_values(kind))
    return followed(scans, profile.solver_parameters())


@pytest.fixture(scope="module")
def hovering():
    return solver_of(OdometryKind.HOVERING)


@pytest.fixture(scope="module")
def ahead():
    return solver_of(OdometryKind.HEADING)


def distances(solver):
    return np.hypot(*errors_of(solver, MADE)[:, :2].T)


def test_it_is_found_where_it_is(hovering):
    assert np.median(distances(hovering)) < 1.0


def test_the_profile_for_vehicles_that_go_ahead_loses_it(ahead):
    assert np.median(distances(ahead)) > 3.0


def test_echoes_tell_that_it_strafes(ahead, hovering):
    assert strafes(ahead, hovering)


def test_a_run_that_is_too_short_to_tell_may_strafe(ahead):
    assert goes_on(ahead.solution) is Answer.NOT_MEASURED


def test_refined_it_is_as_near_as_echoes_tell():
    solver = solver_of(OdometryKind.HOVERING, MADE.scans[:5])
    fit = fitted(solver)
    places = solver.log.node_poses(np.arange(len(fit.node_times)))[:, :2] + fit.state.nodes[:, :2]
    true = MADE.truth.at(fit.node_times)[:, :2]
    assert np.hypot(*(places - places[0] - true + true[0]).T).mean() < 0.7


def test_each_part_of_a_turn_has_an_estimate(hovering):
    ends = [estimate.time for estimate in hovering.estimates]
    assert len(ends) == PARTS * len(MADE.scans)
    np.testing.assert_allclose(ends[PARTS - 1 :: PARTS], TURN * np.arange(1, len(MADE.scans) + 1))


def test_equal_runs_find_equal_paths(hovering):
    again = solver_of(OdometryKind.HOVERING, MADE.scans[:4])
    few = len(again.estimates)
    np.testing.assert_allclose(
        [estimate.T_map_base for estimate in again.estimates],
        [estimate.T_map_base for estimate in hovering.estimates[:few]],
    )


def test_a_stored_run_goes_on_as_it_would_have():
    first = solver_of(OdometryKind.HOVERING, MADE.scans[:5])
    again = LiveSolver.resumed(first.parameters, logged(MADE.scans[:5], SONAR_IN_BASE, 3), first.stored())
    ends = [solver.add(MADE.scans[5]).T_map_base for solver in (first, again)]
    np.testing.assert_allclose(ends[1], ends[0])


def test_a_scan_that_comes_twice_leaves_nothing_behind():
    solver = solver_of(OdometryKind.HOVERING, MADE.scans[:3])
    before = solver.state.copy(), solver.log.scan_count
    with pytest.raises(RefusedInput):
        solver.add(MADE.scans[2])
    assert solver.log.scan_count == before[1] == len(solver.estimates)
    np.testing.assert_array_equal(solver.state.nodes, before[0].nodes)
