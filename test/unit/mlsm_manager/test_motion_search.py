"""The search for a scan whose vehicle moved farther than the solver's own steps reach."""

import numpy as np
import pytest
from made_harbour import ahead, logged, tour
from made_models import DVL, HEADING, UNAIDED, solution_of

from mlsm_manager.joint_solver.motion_models import Transition
from mlsm_manager.joint_solver.normal_equations import YAW, State
from mlsm_manager.joint_solver.place_search import searched_node
from mlsm_manager.joint_solver.placement import NodePath

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
    unaided = UNAIDED
    state = state_with(log, unaided, np.array([1.0, 1.0]))
    state.nodes[-1, YAW] = turn
    covariance = np.diag([0.0, 0.0, 0.0, 0.3, 0.3, 0.3, 0.05]) ** 2
    found = searched_node(solution_of(log, unaided, state), covariance)
    assert abs(found[YAW]) < 0.1
    assert np.hypot(*found[:2]) < 1.5


def test_a_motion_that_is_known_is_not_searched(log):
    dvl = DVL
    state = state_with(log, dvl, FAR)
    covariance = np.diag([0.01, 0.01, 0.01, 0.01, 0.01]) ** 2
    assert searched_node(solution_of(log, dvl, state), covariance) is not None
    np.testing.assert_array_equal(searched_node(solution_of(log, dvl, state), covariance)[:2], FAR)


def test_a_speed_that_is_unknown_makes_a_step_unknown(log):
    motion, nodes = log.node_motion(np.array([1, 2])), np.zeros((2, HEADING.width))
    transition = Transition.of(HEADING, nodes, motion)
    at_rest = transition.step_covariance(np.zeros((6, 6)))
    moving = transition.step_covariance(np.diag([9.0, 9.0, 9.0, 0.3, 0.0, 0.3]) ** 2)
    seconds = motion.times[1] - motion.times[0]
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
    path = NodePath(HEADING, log.odometry, times, nodes).at(between)
    np.testing.assert_allclose(path[:, :2], 0.2 * log.odometry.motion(between).ahead, atol=1e-9)
