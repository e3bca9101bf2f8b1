"""Where a scan may be: searched for, in a map from before the run, and on what was heard before it."""

from dataclasses import replace

import numpy as np
import pytest
from made_harbour import SONAR_IN_BASE, ahead, logged, tour
from made_models import DVL, HEADING, UNAIDED, followed, solution_of, solver_parameters
from made_posts import heard, true_path

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


def run_with(log, model, shift, turn=0.0):
    """Return a run in its true state, but for the newest node, which is `shift` (2,) [m] and `turn` [rad] off."""
    nodes = np.zeros((log.scan_count + 1, model.width))
    nodes[-1, :3] = *shift, turn
    return solution_of(log, model, State(nodes, np.zeros(2)))


@pytest.mark.parametrize("shift", [FAR, np.zeros(2)], ids=["metres beside", "where it is"])
def test_a_scan_is_found_wherever_it_was_expected(log, shift):
    found = searched_node(run_with(log, HEADING, shift), np.diag([0.0, 0.0, 0.0, 0.3, 0.3, 0.3]) ** 2)
    assert np.hypot(*found[:2]) < 1.5
    assert np.hypot(*found[3:5]) > 0.05 or not shift.any()  # a node that is moved has another velocity


@pytest.mark.parametrize("turn", [-1.2, 0.5])
def test_a_turn_that_nobody_measured_is_found(log, turn):
    """A vehicle without a compass: the newest node is turned against the true heading, and beside the true place."""
    covariance = np.diag([0.0, 0.0, 0.0, 0.3, 0.3, 0.3, 0.05]) ** 2
    found = searched_node(run_with(log, UNAIDED, (1.0, 1.0), turn), covariance)
    assert abs(found[YAW]) < 0.1
    assert np.hypot(*found[:2]) < 1.5


def test_a_motion_that_is_known_is_not_searched(log):
    np.testing.assert_array_equal(searched_node(run_with(log, DVL, FAR), 0.01**2 * np.eye(5))[:2], FAR)


def test_a_speed_that_is_unknown_makes_a_step_unknown(log):
    solution = run_with(log, HEADING, np.zeros(2))
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
KNOWN = np.concatenate([scan.points[:, :2] for scan in tour(4, seed=1).scans])
ELSEWHERE = np.array([400.0, -900.0])
BEGUN = followed(HARBOUR.scans[:1], PARAMETERS)
SOURCES = BEGUN.solution.placed(BEGUN.log.surfaces.heard(0, 1))


def compared(places, sources=SOURCES):
    """Return the comparisons of a scan's points with a map of `places` (n, 2), and the surfaces that they meet."""
    return KnownSurfaces(places).compared(sources, 2.2, solver_parameters())


@pytest.mark.parametrize("places", [np.empty((0, 2)), np.array([[1.0, 2.0]])])
def test_a_map_without_a_line_is_compared_with_nothing(places):
    pairs, targets = compared(places)
    assert len(pairs.rows) == len(targets) == 0


def test_normals_of_the_map_point_as_those_of_the_scan():
    pairs, targets = compared(KNOWN)
    assert len(pairs.rows) > 40
    assert (np.einsum("na,na->n", SOURCES.normals[pairs.rows], targets.normals[pairs.neighbours]) > 0.0).all()


@pytest.mark.parametrize(("shift", "free_scans", "within"), [((0.6, -0.4, 0.0), 40, 0.1), ((0.0, 0.0, 0.0), 2, 0.2)])
def test_a_run_is_drawn_onto_its_map_also_when_its_first_scans_are_frozen(shift, free_scans, within):
    known = KnownSurfaces(transformed(np.array(shift), KNOWN))
    parameters = replace(PARAMETERS, free_scans=free_scans)
    solver = LiveSolver(parameters, RunLog(SONAR_IN_BASE), start=np.array([1.0, 1.0, 0.05]), known=known)
    estimates = [solver.add(scan) for scan in HARBOUR.scans]
    np.testing.assert_allclose(estimates[-1].T_map_base - estimates[-1].T_odom_base, shift, atol=within)


def test_blocks_far_from_the_vehicle_change_nothing():
    (near, targets), (same, others) = compared(KNOWN), compared(np.concatenate([KNOWN + ELSEWHERE, KNOWN]))
    np.testing.assert_array_equal(near.rows, same.rows)
    np.testing.assert_array_equal(targets.places, others.places)
    np.testing.assert_allclose(targets.normals, others.normals, atol=1e-12)


def test_a_vehicle_that_goes_far_meets_what_is_there():
    known = KnownSurfaces(np.concatenate([KNOWN, KNOWN + ELSEWHERE]))
    places = (SOURCES.places, SOURCES.places + ELSEWHERE, SOURCES.places)
    sources = [replace(SOURCES, places=each) for each in places]
    before, there, again = (known.compared(each, 2.2, solver_parameters())[0].rows for each in sources)
    assert len(there) > 40
    np.testing.assert_array_equal(there, again)
    np.testing.assert_array_equal(before, again)


WALL = np.column_stack([np.arange(-2.0, 2.5, 0.5), np.full(9, 5.0)])


def drawn_to(x):
    """Return the place (2,) that a point at (x, 5.1) is drawn to, beside a wall with a block every half metre."""
    point = replace(SOURCES.selected(np.array([0])), places=np.array([[x, 5.1]]), normals=np.array([[0.0, 1.0]]))
    pairs, targets = compared(WALL, point)
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
    shares = shares_at(posts_log, 0.0)
    assert np.isnan(shares[0])  # it has none before it
    assert shares[1:].min() > 0.8
    assert shares_at(posts_log, 5.0)[1:].max() < 0.2


def test_new_surfaces_say_nothing_against_a_place():
    """As of a scan whose echoes lie 100 m along the canal, out of sight of all others."""
    scans = heard(3)
    far = replace(scans[2], points=scans[2].points + np.array([100.0, 0.0, 0.0, 0.0]))
    assert np.isnan(shares_at(logged([*scans[:2], far], np.zeros(2)), 0.0)[2])


@pytest.mark.parametrize(("aside", "model"), [(0.0, HEADING), (6.0, DVL)], ids=["in place", "reported"])
def test_scans_at_their_places_and_reported_motions_leave_the_path_as_certain_as_it_is(posts_log, aside, model):
    np.testing.assert_array_equal(variances_at(posts_log, aside, model), np.zeros(TURNS))


def test_the_place_is_the_less_certain_the_worse_a_scan_fits(posts_log):
    found = [variances_at(posts_log, aside)[-1] for aside in (0.0, 2.5, 4.0, 6.0)]
    assert np.all(np.diff(found) > 0.0)


def test_a_turn_in_which_nothing_fits_is_as_uncertain_as_a_vehicle_goes_far(posts_log):
    seconds = np.diff(posts_log.node_times)[-1]
    assert 0.2 * seconds < np.sqrt(variances_at(posts_log, 7.0)[-1]) <= 0.5 * seconds
