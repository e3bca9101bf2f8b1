"""Odometry models: derivatives, what they expect, and that they use of the odometry only what they say."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from made_harbour import CANAL, ahead, along_canal, deaf, reporting, selected, tour
from made_models import COMPASS, errors_of, followed

from mlsm_manager.joint_solver.batch_solver import fit_of
from mlsm_manager.joint_solver.estimate import scale_covariance
from mlsm_manager.joint_solver.normal_equations import YAW, Layout, NormalEquations, Residuals, prior_of, solution_of
from mlsm_manager.joint_solver.odometry_log import Motion, OdometryLog
from mlsm_manager.joint_solver.velocity_models import by_heading
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.localisation.parameters import MlsmCoreParameters
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import harmonics, seen_from

pytestmark = pytest.mark.long

STEP = 1e-6
TIMES = np.array([0.0, 14.0, 28.0])
POSES = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.3], [3.0, 2.0, 0.5]])
MOTION = Motion(TIMES, POSES, np.array([[0.0, 0.0], [13.5, 2.0], [26.0, 8.0]]), np.zeros(3))
KINDS = list(OdometryKind)


def parameters(kind, **changes):
    return MlsmCoreParameters().changed({**profile_values(kind), **changes}).solver_parameters()


def model_of(kind):
    return parameters(kind).odometry


def some_nodes(model):
    nodes = np.random.RandomState(2).normal(0.0, 0.05, (3, model.width))
    if model.mixture is not None:
        nodes[:, list(model.mixture.columns)] = nodes[0, list(model.mixture.columns)]  # they do not walk
    if "odometry_scale" in model.calibrated:
        nodes[:, model.calibrated["odometry_scale"]] = 0.0  # there residuals are the same as those per unit of scale
    return nodes


def step_of_motion(node):
    rows = slice(node, node + 2)
    return Motion(TIMES[rows], POSES[rows], MOTION.ahead[rows], MOTION.held[rows])


def equations_of(model, nodes, motion=MOTION):
    equations = NormalEquations(Layout(0, 2, model.width).size)
    equations.add(*model.steps(nodes, motion))
    return equations


@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_that_went_as_expected_pulls_at_nothing(kind):
    model = model_of(kind)
    nodes = [np.random.RandomState(4).normal(0.0, 0.1, model.width)]
    nodes[0][2] = 0.0  # a compass error is expected to fade
    for node in range(2):
        nodes.append(model.advanced(nodes[-1][np.newaxis], step_of_motion(node))[0])
    np.testing.assert_allclose(equations_of(model, np.array(nodes)).gradient, 0.0, atol=2e-2)


@pytest.mark.parametrize("kind", KINDS)
def test_rates_go_on_live_as_the_nodes_are_expected_to(kind):
    model = model_of(kind)
    node, fading = some_nodes(model)[0], model.fading(some_nodes(model)[0])
    later = model.advanced(node[np.newaxis], step_of_motion(0))[0]
    now, then = (model.drift(one, 0.3).values[:3] for one in (node, later))
    expected = now if fading is None else fading.after(now, TIMES[1] - TIMES[0])
    np.testing.assert_allclose(then, expected, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_residuals_and_derivatives_agree(kind):
    model = model_of(kind)
    nodes = some_nodes(model)
    gradient = equations_of(model, nodes).gradient
    for column in range(model.width):
        if column == model.calibrated.get("odometry_scale"):
            continue
        up, down = nodes.copy(), nodes.copy()
        up[1, column] += STEP
        down[1, column] -= STEP
        cost = (equations_of(model, up).cost - equations_of(model, down).cost) / STEP / 4.0
        assert cost == pytest.approx(gradient[model.width + column], rel=1e-3, abs=1e-3)


def test_what_the_world_s_scale_leaves_open_grows_from_the_map_s_origin():
    covariances = scale_covariance(np.array([[0.0, 0.0, 1.0], [30.0, 40.0, 2.0]]), 0.02)
    np.testing.assert_allclose(covariances[0], 0.0)
    assert np.sqrt(np.trace(covariances[1])) == pytest.approx(0.02 * 50.0)


@pytest.mark.parametrize("kind", [OdometryKind.HEADING, OdometryKind.NONE])
def test_reported_positions_say_nothing_where_only_the_heading_counts(kind):
    model = model_of(kind)
    nodes, positions = some_nodes(model), np.array([[5.0, 1.0], [-3.0, 9.0], [0.0, 4.0]])
    elsewhere = nodes.copy()
    elsewhere[:, :2] += POSES[:, :2] - positions
    other = Motion(TIMES, np.column_stack([positions, POSES[:, 2]]), MOTION.ahead, MOTION.held)
    there, here = equations_of(model, elsewhere, other), equations_of(model, nodes)
    np.testing.assert_allclose(there.gradient, here.gradient, rtol=1e-9, atol=1e-9)


def in_pieces(track, *ends):
    log = OdometryLog()
    for end in ends:
        log.extend(track, end)
    return log


def test_ahead_is_where_a_vehicle_would_be_that_always_went_ahead():
    times = np.linspace(0.0, 10.0, 1001)
    yaw = 0.3 * times
    track = Track(times, np.column_stack([0.0 * times, 0.0 * times, yaw]))
    expected = np.column_stack([np.sin(yaw), 1.0 - np.cos(yaw)]) / 0.3
    logs = OdometryLog.of(track), in_pieces(track, 3.0, 3.05, 7.2, 10.0)
    whole, pieces = (log.motion(times).ahead for log in logs)
    np.testing.assert_allclose(whole, expected, atol=1e-4)
    np.testing.assert_allclose(pieces, whole, atol=1e-12)


def stalled(heading):
    """Return the track of an odometry that stands still from 3 to 9 s; heading: rad per second."""
    times = np.linspace(0.0, 12.0, 121)
    moved = np.minimum(times, 3.0) + np.maximum(times - 9.0, 0.0)
    return Track(times, np.column_stack([moved, 0.0 * times, heading * times]))


@pytest.mark.parametrize(("heading", "held"), [(0.01, 4.0), (0.0, 0.0)])
def test_positions_are_held_where_they_stand_while_the_heading_changes(heading, held):
    """From two seconds on; where the heading stands too, the vehicle is at rest."""
    track = stalled(heading)
    for log in (in_pieces(track, 4.0, 4.05, 7.2, 12.0), OdometryLog.of(track)):
        np.testing.assert_allclose(log.motion(np.array([0.0, 5.0, 12.0])).held, [0.0, 0.0, held], atol=0.15)


@pytest.mark.parametrize("kind", [OdometryKind.DVL, OdometryKind.THRUSTERS])
def test_while_positions_are_held_nobody_knows_how_far_the_vehicle_goes(kind):
    model = model_of(kind)
    nodes = model.first_node() + np.array([[0.0], [4.0], [4.0]]) * np.eye(model.width)[0]
    held = Motion(TIMES, POSES, MOTION.ahead, np.array([0.0, 14.0, 14.0]))
    assert equations_of(model, nodes).cost > 5.0 * equations_of(model, nodes, held).cost


@pytest.fixture(scope="module")
def made():
    return tour(20, path=ahead)


@pytest.fixture(scope="module")
def solver_of(made):
    """Return a call that gives the solver of a kind of odometry, after the whole tour."""
    return lru_cache(maxsize=None)(lambda kind: followed(made.scans, parameters(kind)))


# Of hovering vehicles test_strafing.py tells.
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind is not OdometryKind.HOVERING])
def test_each_model_follows_a_vehicle_in_a_harbour(kind, made, solver_of):
    error = errors_of(solver_of(kind), made)
    assert np.hypot(*error[8:, :2].T).max() < 1.5


def test_a_velocity_that_nobody_reported_is_found_with_its_deviation(made, solver_of):
    solver = solver_of(OdometryKind.HEADING)
    for estimate in solver.estimates[10:]:
        true = seen_from(*made.truth.at(estimate.time + np.array([-4.0, 0.0]))) / 4.0
        deviation = np.sqrt(np.diag(estimate.velocity_covariance)[:2])
        assert (np.abs(estimate.velocity[:2] - true[:2]) < 4.0 * deviation + 0.1).all()
        assert (deviation < 0.2).all()


@pytest.mark.parametrize("kind", [OdometryKind.THRUSTERS, OdometryKind.AUTO])
def test_a_scale_that_is_30_percent_off_is_found(kind, made):
    solver = followed([reporting(scan, 1.0 / 1.3) for scan in made.scans], parameters(kind))
    column = solver.odometry.calibrated["odometry_scale"]
    assert solver.estimates[-1].node[column] == pytest.approx(0.3, abs=0.06)


def test_a_deviation_grows_while_nothing_is_heard_and_covers_the_error(made):
    solver = followed(deaf(made.scans, range(8, 17)), parameters(OdometryKind.HEADING))
    radii = np.array([estimate.stated_deviation for estimate in solver.estimates])
    distance = np.hypot(*errors_of(solver, made)[:, :2].T)
    assert (np.diff(radii[8:17]) > 0.0).all()
    assert radii[16] > 3.0 * radii[7]
    assert distance[16] < 3.0 * radii[16]


def in_canal(count, **changes):
    """Return a tour of a straight canal, and the solver after its scans without echoes from beyond 30 m."""

    def heard(scan):
        return selected(scan, np.hypot(*(scan.points - scan.track.at(scan.times)[:, [0, 1, 2, 2]])[:, :2].T) < 30.0)

    canal = tour(count, noise=0.3, path=along_canal, corners=CANAL)
    return canal, followed(map(heard, canal.scans), parameters(OdometryKind.HEADING, **changes))


def test_in_a_straight_canal_the_told_deviation_covers_the_error():
    canal, solver = in_canal(45)
    told = np.array([estimate.stated_deviation for estimate in solver.estimates])
    distance = np.hypot(*errors_of(solver, canal)[:, :2].T)
    assert (distance < 3.0 * told).all()
    assert told[-1] > 5.0


def test_the_fit_of_a_whole_run_settles_where_nothing_tells_the_way():
    batch = fit_of(in_canal(15, free_scans=5)[1].solution)
    assert batch.converged
    assert batch.steps < 15


def test_a_compass_tells_no_turns_while_it_is_stuck():
    times = 14.0 * np.arange(5)
    stuck, usual = (compass.change(times) for compass in (replace(COMPASS, stuck=((20.0, 35.0),)), COMPASS))
    np.testing.assert_array_equal(stuck.kept, usual.kept)
    np.testing.assert_allclose(np.sqrt(stuck.variance - usual.variance), 0.22 * np.sqrt([0.0, 8.0, 7.0, 0.0]))


def test_a_compass_that_errs_by_the_heading_is_an_unknown_that_is_eliminated():
    nodes, times = np.arange(10), 14.0 * np.arange(10)
    yaws, layout = np.random.RandomState(1).uniform(-3.0, 3.0, 10), Layout(0, 9, 3)
    change, columns = COMPASS.change(times), layout.node_start(nodes) + YAW
    errors = COMPASS.heading_deviation * harmonics(yaws) * [5.0, 5.0, 1.0, 1.0]
    with_errors, without = NormalEquations(layout.size + 4), NormalEquations(layout.size)
    for equations, count in ((with_errors, 4), (without, 0)):
        own = np.tile(layout.size + np.arange(count), (10, 1))
        kept = change.kept[:, np.newaxis]
        steps = np.column_stack([np.ones(9), -change.kept, (errors[1:] - kept * errors[:-1])[:, :count]])
        places = np.column_stack([columns[1:], columns[:-1], own[1:]])
        equations.add(Residuals(places, steps, np.zeros(9), 1.0 / change.variance))
        first = np.append(1.0, errors[0, :count])[np.newaxis]
        start = np.append(columns[0], own[0])[np.newaxis]
        equations.add(Residuals(start, first, np.zeros(1), np.array([COMPASS.heading_deviation**-2.0])))
        unknowns = np.arange(layout.size + count)
        told = np.where(unknowns < layout.size, 0.03, 1.0)  # by the echoes, and of errors of one beforehand
        equations.add(prior_of(unknowns, np.zeros(len(unknowns)), told))
    found = by_heading(COMPASS, layout, yaws, times, solution_of(without).solve)
    covariance = np.linalg.inv(with_errors.dense()[0])[: layout.size, : layout.size]
    np.testing.assert_allclose(np.linalg.inv(without.dense()[0]) + found @ found.T, covariance, atol=1e-9)
