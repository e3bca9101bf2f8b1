"""Where a scan may be: searched for, in a map from before the run, and on what was heard before it."""

from dataclasses import replace

import numpy as np
import pytest
from made_harbour import ahead, logged, tour
from made_models import DVL, HEADING, UNAIDED, solution_of, solver_parameters
from made_posts import heard, true_path

from mlsm_manager.joint_solver.compiled_comparisons import Pairs
from mlsm_manager.joint_solver.known_surfaces import KnownSurfaces
from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.map_support import misfit_variances, shares_heard_before
from mlsm_manager.joint_solver.normal_equations import YAW, State
from mlsm_manager.joint_solver.places import covariance_since, searched_node
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.solution import solved_path
from node_support.geometry import transformed

FAR = np.array([3.0, -5.0])


@pytest.fixture(scope="module")
def log():
    return logged(tour(6, path=ahead).scans)


def state_with(log, model, shift):
    """Return the true state, but for the newest node, which is `shift` (2,) [m] off."""
    nodes = np.zeros((log.scan_count + 1, model.width))
    nodes[-1, :2] = shift
    return State(nodes, np.zeros(2))


def test_a_scan_is_found_metres_from_where_it_was_expected(log):
    covariance = np.diag([0.0, 0.0, 0.0, 0.3, 0.3, 0.3]) ** 2
    found = searched_node(solution_of(log, HEADING, state_with(log, HEADING, FAR)), covariance)
    assert np.hypot(*found[:2]) < 1.5
    assert np.hypot(*found[3:5]) > 0.05  # a node that is moved has another velocity


def test_a_scan_that_is_where_it_was_expected_stays(log):
    covariance = np.diag([0.0, 0.0, 0.0, 0.3, 0.3, 0.3]) ** 2
    found = searched_node(solution_of(log, HEADING, state_with(log, HEADING, np.zeros(2))), covariance)
    assert np.hypot(*found[:2]) < 1.5


@pytest.mark.parametrize("turn", [-1.2, 0.5])
def test_a_turn_that_nobody_measured_is_found(log, turn):
    """A vehicle without a compass: the newest node is turned against the true heading, and beside the true place."""
    state = state_with(log, UNAIDED, np.array([1.0, 1.0]))
    state.nodes[-1, YAW] = turn
    covariance = np.diag([0.0, 0.0, 0.0, 0.3, 0.3, 0.3, 0.05]) ** 2
    found = searched_node(solution_of(log, UNAIDED, state), covariance)
    assert abs(found[YAW]) < 0.1
    assert np.hypot(*found[:2]) < 1.5


def test_a_motion_that_is_known_is_not_searched(log):
    covariance = np.diag([0.01, 0.01, 0.01, 0.01, 0.01]) ** 2
    np.testing.assert_array_equal(searched_node(solution_of(log, DVL, state_with(log, DVL, FAR)), covariance)[:2], FAR)


def test_a_speed_that_is_unknown_makes_a_step_unknown(log):
    solution = solution_of(log, HEADING, state_with(log, HEADING, np.zeros(2)))
    at_rest = covariance_since(solution, np.zeros((6, 6)), 0)
    moving = covariance_since(solution, np.diag([9.0, 9.0, 9.0, 0.3, 0.0, 0.3]) ** 2, 0)
    seconds = np.diff(log.node_times)[-1]
    added = np.sqrt(np.trace(moving[:2, :2] - at_rest[:2, :2]))
    assert 0.7 * 0.3 * seconds < added < 0.3 * seconds


def test_the_path_of_a_heading_bends_between_nodes_as_the_heading_did(log):
    """A vehicle that goes ahead at a known speed is where the integral of its heading is, all the way."""
    times = log.node_times[:3]
    ahead_of_nodes = log.odometry.motion(times).ahead
    nodes = np.zeros((3, HEADING.width))
    nodes[:, :2] = 0.2 * ahead_of_nodes - log.odometry.at(times)[:, :2]
    nodes[:, 3] = 0.2
    between = np.linspace(times[0], times[-1], 40)
    path = solved_path(log.odometry, HEADING, times, nodes, between)
    np.testing.assert_allclose(path[:, :2], 0.2 * log.odometry.motion(between).ahead, atol=1e-9)


HARBOUR = tour(4)
PARAMETERS = solver_parameters(sonar_delay_deviation=0.01)
SONAR = np.array([0.3, 0.0])


def known_places():
    return np.concatenate([scan.points[:, :2] for scan in tour(4, seed=1).scans])


def pairs_with(known):
    solver = LiveSolver(PARAMETERS, RunLog(SONAR))
    solver.add(HARBOUR.scans[0])
    sources = solver.solution.placed(solver.log.surfaces.heard(0, 1))
    return known.compared(sources, 2.2, solver_parameters()), sources


@pytest.mark.parametrize("places", [np.empty((0, 2)), np.array([[1.0, 2.0]])])
def test_a_map_without_a_line_is_compared_with_nothing(places):
    (pairs, targets), _ = pairs_with(KnownSurfaces(places))
    assert isinstance(pairs, Pairs)
    assert len(pairs.rows) == len(targets) == 0


def test_normals_of_the_map_point_as_those_of_the_scan():
    (pairs, targets), sources = pairs_with(KnownSurfaces(known_places()))
    assert len(pairs.rows) > 40
    assert (np.einsum("na,na->n", sources.normals[pairs.rows], targets.normals[pairs.neighbours]) > 0.0).all()


def test_a_run_that_starts_beside_its_map_is_drawn_onto_it():
    shift = np.array([0.6, -0.4, 0.0])
    known = KnownSurfaces(transformed(shift, known_places()))
    solver = LiveSolver(PARAMETERS, RunLog(SONAR), start=np.array([1.0, 1.0, 0.05]), known=known)
    for scan in HARBOUR.scans:
        estimate = solver.add(scan)
    np.testing.assert_allclose(estimate.T_map_base - estimate.T_odom_base, shift, atol=0.1)


def test_a_run_in_a_known_map_goes_on_when_its_first_scans_are_frozen():
    parameters = replace(PARAMETERS, free_scans=2)
    solver = LiveSolver(
        parameters, RunLog(SONAR), start=np.array([1.0, 1.0, 0.05]), known=KnownSurfaces(known_places())
    )
    estimates = [solver.add(scan) for scan in HARBOUR.scans]
    np.testing.assert_allclose(estimates[-1].T_map_base, estimates[-1].T_odom_base, atol=0.2)


def test_blocks_far_from_the_vehicle_change_nothing():
    far = known_places() + np.array([400.0, -900.0])
    (near, targets), _ = pairs_with(KnownSurfaces(known_places()))
    (same, others), _ = pairs_with(KnownSurfaces(np.concatenate([far, known_places()])))
    np.testing.assert_array_equal(near.rows, same.rows)
    np.testing.assert_array_equal(targets.places, others.places)
    np.testing.assert_allclose(targets.normals, others.normals, atol=1e-12)


def test_a_vehicle_that_goes_far_meets_what_is_there():
    known = KnownSurfaces(np.concatenate([known_places(), known_places() + np.array([400.0, -900.0])]))
    _, sources = pairs_with(known)
    there = replace(sources, places=sources.places + np.array([400.0, -900.0]))
    pairs, _ = known.compared(there, 2.2, solver_parameters())
    assert len(pairs.rows) > 40
    again, _ = known.compared(sources, 2.2, solver_parameters())
    np.testing.assert_array_equal(pairs.rows, again.rows)


WALL = np.column_stack([np.arange(-2.0, 2.5, 0.5), np.full(9, 5.0)])


def drawn_to(x):
    """Return the place (2,) that a point at (x, 5.1) is drawn to, beside a wall with a block every half metre."""
    _, sources = pairs_with(KnownSurfaces(known_places()))
    point = replace(sources.selected(np.array([0])), places=np.array([[x, 5.1]]), normals=np.array([[0.0, 1.0]]))
    pairs, targets = KnownSurfaces(WALL).compared(point, 2.2, solver_parameters())
    return (pairs.importance[:, np.newaxis] * targets.places[pairs.neighbours]).sum(axis=0) / pairs.importance.sum()


def test_a_point_between_two_blocks_is_compared_with_both():
    np.testing.assert_allclose(drawn_to(0.25), [0.25, 5.0], atol=1e-9)


def test_which_block_is_nearer_does_not_hang_on_a_bit():
    np.testing.assert_allclose(drawn_to(0.25 - 1e-9), drawn_to(0.25 + 1e-9), atol=1e-6)


TURNS = 4


@pytest.fixture(scope="module")
def posts_log():
    return logged(heard(TURNS), np.zeros(2))


def measured(measure, posts_log, aside, model=HEADING):
    """Return what `measure` finds where the nodes lie `aside` (n,) [m] across the canal of their true places."""
    nodes = np.zeros((posts_log.scan_count + 1, model.width))
    nodes[:, :2] = true_path(posts_log.node_times)
    nodes[:, 1] = aside
    return measure(solution_of(posts_log, model, State(nodes, np.zeros(2))), 0)


def shares_at(posts_log, step):
    """Return the shares where each scan lies `step` [m] across the canal of the one before."""
    return measured(shares_heard_before, posts_log, step * np.arange(posts_log.scan_count + 1))


def variances_at(posts_log, aside, model=HEADING):
    """Return the variances where the last scan lies `aside` [m] across the canal of its true place."""
    return measured(misfit_variances, posts_log, np.append(np.zeros(posts_log.scan_count), aside), model)


def test_scans_lie_on_what_was_heard_before_where_they_are_and_not_where_they_are_not(posts_log):
    assert shares_at(posts_log, 0.0)[1:].min() > 0.8
    assert shares_at(posts_log, 5.0)[1:].max() < 0.2


def test_new_surfaces_say_nothing_against_a_place():
    """As of a scan whose echoes lie 100 m along the canal, out of sight of all others."""
    scans = heard(3)
    far = replace(scans[2], points=scans[2].points + np.array([100.0, 0.0, 0.0, 0.0]))
    assert np.isnan(shares_at(logged([*scans[:2], far], np.zeros(2)), 0.0)[2])


def test_the_first_scan_has_none_before_it(posts_log):
    assert np.isnan(shares_at(posts_log, 0.0)[0])


def test_scans_at_their_places_leave_the_path_as_certain_as_it_is(posts_log):
    np.testing.assert_array_equal(variances_at(posts_log, 0.0), np.zeros(TURNS))


def test_the_place_is_the_less_certain_the_worse_a_scan_fits(posts_log):
    found = [variances_at(posts_log, aside)[-1] for aside in (0.0, 2.5, 4.0, 6.0)]
    assert np.all(np.diff(found) > 0.0)


def test_a_turn_in_which_nothing_fits_is_as_uncertain_as_a_vehicle_goes_far(posts_log):
    seconds = np.diff(posts_log.node_times)[-1]
    assert 0.2 * seconds < np.sqrt(variances_at(posts_log, 7.0)[-1]) <= 0.5 * seconds


def test_a_reported_motion_is_not_lost_with_a_scan(posts_log):
    np.testing.assert_array_equal(variances_at(posts_log, 6.0, DVL), np.zeros(TURNS))
