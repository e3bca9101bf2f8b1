"""Comparisons of points: which neighbours, how much each counts, and what they say, as a few lines of numpy find it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_harbour import SONAR_IN_BASE, logged, tour
from made_models import (
    DVL,
    HEADING,
    THRUSTERS,
    UNAIDED,
    followed,
    points_of,
    solution_of,
    solver_parameters,
    some_state,
)

from mlsm_manager.joint_solver.comparisons import COSINE_FADING, FADING, TIE, neighbours_of, summed
from mlsm_manager.joint_solver.compiled_comparisons import Pairs, scattered_terms, weighed_pairs
from mlsm_manager.joint_solver.normal_equations import RANGE_SCALE
from mlsm_manager.joint_solver.odometry_log import as_complex
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.solution import solved_path
from mlsm_manager.joint_solver.surface_points import ramp
from mlsm_manager.joint_solver.weak_directions import discounted
from node_support.geometry import rotated

SAME = 1e-9
STEP = 1e-6
PLACES = 3 * np.arange(4)[:, np.newaxis] + np.arange(2)  # columns of x and y of the four nodes of a pair
MODELS = [DVL, THRUSTERS, HEADING, UNAIDED]


@pytest.fixture(scope="module")
def log():
    return logged(tour(3, direction=0.1, delay=0.3).scans)


def some_points(rng, count, scans):
    return PlacedPoints(
        scans=np.sort(rng.choice(scans, count)), places=rng.normal(0.0, 3.0, (count, 2)),
        arms=rng.normal(0.0, 9.0, (count, 2)), normals=rng.normal(0.0, 1.0, (count, 2)),
        slants=rng.uniform(0.0, 5.0, count), qualities=np.ones(count), shares=rng.uniform(0.0, 1.0, count),
        by_run=rng.normal(0.0, 5.0, (count, 2, 2)),
    )  # fmt: skip


def linearised(pairs, sources, targets):
    """Return residuals (m,) along the targets' normals per unit of range scale, and their derivatives (m, 14).

    The targets' normals turn with them.
    """
    i, j = pairs.rows, pairs.neighbours
    normals, apart = targets.normals[j], sources.places[i] - targets.places[j]
    residual = np.einsum("na,na->n", apart, normals)
    late, later = sources.shares[i, np.newaxis], targets.shares[j, np.newaxis]
    by_source, by_target = by_pose(sources.arms[i], normals), -by_pose(targets.arms[j] + apart, normals)
    by_run = np.einsum("nar,na->nr", sources.by_run[i] - targets.by_run[j], normals)
    by_run[:, RANGE_SCALE] -= residual
    parts = [(1.0 - late) * by_source, late * by_source, (1.0 - later) * by_target, later * by_target, by_run]
    return residual, np.concatenate(parts, axis=1)


def by_pose(arms, normals):
    return np.column_stack([normals, arms[:, 0] * normals[:, 1] - arms[:, 1] * normals[:, 0]])


def weights(residual, pairs, sources, targets, parameters, cut):
    slants = sources.slants[pairs.rows] ** 2 + targets.slants[pairs.neighbours] ** 2
    variance = parameters.echo_deviation**2 + parameters.beam_half_width**2 * slants
    widening = max(1.0, cut / parameters.cut)
    return parameters.weight / variance / (1.0 + residual**2 / variance / widening**2) ** 2 * pairs.importance


@given(st.integers(0, 10**6), st.integers(1, 200), st.sampled_from([[-2], [0], [3, 4, 9], list(range(40))]))
def test_comparisons_are_summed_for_each_pair_of_scans(seed, count, scans):
    rng, parameters = np.random.RandomState(seed), solver_parameters()
    sources, targets = some_points(rng, 30, list(range(50, 60))), some_points(rng, 40, scans)
    pairs = Pairs(np.sort(rng.randint(0, 30, count)), rng.randint(0, 40, count), rng.uniform(0.1, 1.0, count))
    residual, jacobian = linearised(pairs, sources, targets)
    for cut in (parameters.cut, parameters.wide_cut):
        weight = weights(residual, pairs, sources, targets, parameters, cut)
        found = list(zip(*summed(pairs, sources, targets, parameters, cut)))
        for scan, other, information, gradient in found:
            own = (sources.scans[pairs.rows] == scan) & (targets.scans[pairs.neighbours] == other)
            weighted = jacobian[own] * weight[own, np.newaxis]
            expected = weighted.T @ jacobian[own]
            np.testing.assert_allclose(information, expected, rtol=SAME, atol=SAME * np.abs(expected).max())
            expected = weighted.T @ residual[own]
            np.testing.assert_allclose(gradient, expected, rtol=SAME, atol=SAME * np.abs(weighted).sum())
        compared = set(zip(sources.scans[pairs.rows], targets.scans[pairs.neighbours]))
        assert sorted((scan, other) for scan, other, _, _ in found) == sorted(compared)


@pytest.mark.parametrize("column", range(3))
def test_residuals_follow_the_nodes_as_their_derivatives_say(log, column):
    state, points = some_state(log), log.surfaces.heard(0, 3)
    pairs = Pairs(np.arange(20), np.arange(150, 170), np.ones(20))
    before = solution_of(log, DVL, state).placed(points)
    _, jacobian = linearised(pairs, before, before)
    state.nodes[0, column] += STEP
    after = solution_of(log, DVL, state).placed(points)
    moves = after.places[pairs.rows] - before.places[pairs.rows]
    change = np.einsum("na,na->n", moves, before.normals[pairs.neighbours])
    np.testing.assert_allclose(change / STEP, jacobian[:, column], atol=1e-4)


@pytest.mark.parametrize("normal_deviation", [0.0, 0.2])
def test_comparisons_do_not_tell_how_the_whole_map_is_turned(log, normal_deviation):
    solution, parameters = solution_of(log, DVL, some_state(log)), solver_parameters()
    points, places = solution.placed(log.surfaces.heard(0, 3)), solution.places
    rows = np.arange(len(points))
    pairs = Pairs(rows, np.random.RandomState(2).permutation(rows), np.ones(len(rows)))
    scans, others, information, gradient = summed(pairs, points, points, parameters, parameters.cut)
    left, _ = discounted(information, gradient, scans, PLACES, normal_deviation)
    turn = np.column_stack([-places[:, 1], places[:, 0], np.ones(len(places))])
    nodes = np.stack([scans, scans + 1, others, others + 1], axis=1)
    turned = np.pad(turn[nodes].reshape(len(scans), -1), ((0, 0), (0, 2)), mode="constant")
    told = np.einsum("gab,gb->ga", left, turned)
    np.testing.assert_allclose(told, 0.0, atol=SAME * np.abs(information).max() * np.abs(turned).max())


def placed_by_numpy(log, odometry, state, rows):
    """Return places, arms, normals and shares of points between two nodes each."""
    points, scans = log.surfaces.points(rows)
    times = points.times + state.run[1]
    at_nodes, motion = log.node_motion(np.arange(log.scan_count + 1)), log.odometry.motion(times)
    share = (times - at_nodes.times[scans]) / np.diff(at_nodes.times)[scans]
    yaw = (1.0 - share) * state.nodes[scans, 2] + share * state.nodes[scans + 1, 2]
    reference, gain = odometry.reference(at_nodes), odometry.gain(state.nodes)
    bow = odometry.reference(motion) - reference[scans] - share * np.diff(reference)[scans]
    bow = (gain[:-1] + gain[1:])[scans] / 2.0 * np.exp(1j * yaw) * bow
    nodes = as_complex(at_nodes.poses[:, :2] + state.nodes[:, :2])
    middle = (1.0 - share) * nodes[scans] + share * nodes[scans + 1]
    heading = motion.poses[:, 2] + yaw
    sight = points.ranges * np.exp(1j * (points.bearings + heading))
    arms = as_complex(log.sonar_in_base) * np.exp(1j * heading) + (1.0 + state.run[0]) * sight + bow
    complex_ones = (np.column_stack([z.real, z.imag]) for z in (middle + arms, arms))
    return (*complex_ones, rotated(points.normals, heading), share)


@pytest.mark.parametrize("odometry", MODELS, ids=lambda model: type(model).__name__)
@pytest.mark.parametrize("delay", [0.0, -1.7, 900.0])
def test_points_lie_on_the_path_whatever_the_odometry_tells(log, odometry, delay):
    state, rows = some_state(log, odometry, delay), log.surfaces.rows(1, 3)
    found = solution_of(log, odometry, state).placed(log.surfaces.points(rows))
    for name, expected in zip(("places", "arms", "normals", "shares"), placed_by_numpy(log, odometry, state, rows)):
        close = SAME * np.abs(expected).max()
        np.testing.assert_allclose(getattr(found, name), expected, rtol=SAME, atol=close, err_msg=name)


@pytest.mark.parametrize("odometry", MODELS, ids=lambda model: type(model).__name__)
def test_the_path_goes_on_beyond_the_nodes_as_the_odometry_does(log, odometry):
    nodes, ends = some_state(log, odometry).nodes[1:3], log.node_times[1:3]
    beyond = ends + np.array([-2.0, 2.0])
    reference, gain = odometry.reference(log.odometry.motion(np.append(ends, beyond))), odometry.gain(nodes)
    steps = [gain.mean(), gain[1]] * np.exp(1j * nodes[:, 2]) * (reference[2:] - reference[:2])
    at_ends, found = (solved_path(log.odometry, odometry, ends, nodes, times) for times in (ends, beyond))
    np.testing.assert_allclose(as_complex(found - at_ends), steps, atol=1e-9)
    turns = (log.odometry.at(beyond) - log.odometry.at(ends))[:, 2]
    np.testing.assert_allclose((found - at_ends)[:, 2], turns, atol=1e-12)


def test_no_points_lie_nowhere(log):
    nothing = solution_of(log, DVL, some_state(log)).placed(log.surfaces.heard(0, 0))
    assert {len(array) for array in vars(nothing).values()} == {0}


def test_a_sonar_s_place_may_be_a_column_of_a_matrix_as_live_nodes_have_it():
    T_base_sonar = np.eye(4)
    T_base_sonar[:2, 3] = SONAR_IN_BASE
    scans, places = tour(2).scans, (SONAR_IN_BASE, T_base_sonar[:2, 3])
    found, expected = (followed(scans, sonar_in_base=place).state.nodes for place in places)
    np.testing.assert_array_equal(found, expected)


@given(st.integers(0, 10**6), st.integers(0, 100))
def test_comparisons_fade_out_with_distance_and_angle(seed, count):
    rng, parameters = np.random.RandomState(seed), solver_parameters()
    sources, targets = some_points(rng, 30, [5, 6]), some_points(rng, 40, [0, 1, 2])
    rows, neighbours = np.sort(rng.randint(0, 30, count)), rng.randint(0, 40, count)
    distance, shares = rng.uniform(0.0, 3.0, count), rng.uniform(0.1, 1.0, count)
    cosine = np.einsum("na,na->n", sources.normals[rows], targets.normals[neighbours])
    limits = (parameters.cut, FADING * parameters.cut, parameters.min_cosine, parameters.min_cosine + COSINE_FADING)
    expected = shares * ramp(distance, *limits[:2]) * ramp(cosine, *limits[2:])
    expected = expected * sources.qualities[rows] * targets.qualities[neighbours]
    own, others = ((points.normals, points.qualities) for points in (sources, targets))
    found = weighed_pairs((rows, neighbours, distance, shares), own, others, limits)
    kept = expected > 0.0
    np.testing.assert_array_equal(found[0], rows[kept])
    np.testing.assert_array_equal(found[1], neighbours[kept])
    np.testing.assert_allclose(found[2], expected[kept], rtol=SAME)


@given(st.integers(0, 10**6), st.integers(0, 20))
def test_terms_are_added_in_their_columns_of_a_matrix(seed, count):
    rng = np.random.RandomState(seed)
    columns, terms = rng.randint(0, 7, (count, 3)), rng.normal(0.0, 1.0, (count, 3, 3))
    expected, found = np.ones((7, 7)), np.ones((7, 7))
    np.add.at(expected, (columns[:, :, np.newaxis], columns[:, np.newaxis]), terms)
    scattered_terms(found, columns, terms)
    np.testing.assert_allclose(found, expected, atol=SAME)


def test_points_without_a_finite_place_are_refused():
    points = some_points(np.random.RandomState(0), 20, [0, 1])
    lost = replace(points, places=points.places * np.where(np.arange(20) == 7, np.nan, 1.0)[:, np.newaxis])
    with pytest.raises(ValueError, match="without a finite place"):
        neighbours_of(lost, points, 2.0, 5)


SCANS = np.repeat(np.arange(6), 15)
BLOCK_SCANS = 3
CUT = 2.0


def placed(places, scans=SCANS):
    return points_of(scans[: len(places)], places=places)


def looked_at_all(places, cut):
    """Return the shares of all pairs (n, n), each pair of points compared."""
    apart = np.hypot(*(places[:, np.newaxis] - places).transpose(2, 0, 1))
    apart[SCANS[:, np.newaxis] == SCANS] = np.inf
    result = np.zeros_like(apart)
    for of_block in (SCANS < BLOCK_SCANS, SCANS >= BLOCK_SCANS):
        nearest = np.where(of_block, apart, np.inf).min(axis=1, keepdims=True)
        share = np.maximum(1.0 - (apart - nearest) / TIE, 0.0) * of_block * (nearest < cut)
        result += share / np.maximum(share.sum(axis=1, keepdims=True), 1e-12)
    return result


MOVES = st.tuples(st.floats(0.0, 3.0), st.sampled_from([1.0, 2.0, 3.5]))


@given(st.integers(0, 1000), st.lists(MOVES, max_size=4), st.floats(0.0, 9.0))
def test_neighbours_are_what_a_look_at_all_points_says_however_far_these_move_and_whatever_the_cut(seed, moves, common):
    rng = np.random.RandomState(seed)
    places = rng.uniform(0.0, 15.0, (len(SCANS), 2))
    for move, cut in [(0.0, CUT), *moves]:
        places = places + rng.normal(0.0, move, places.shape) + common
        rows, neighbours, _, shares = neighbours_of(placed(places), placed(places), cut, BLOCK_SCANS)
        found = np.zeros((len(places), len(places)))
        np.add.at(found, (rows, neighbours), shares)
        np.testing.assert_allclose(found, looked_at_all(places, cut), atol=1e-9)


def test_no_neighbour_takes_over_at_once():
    """A point that moves past the middle between two others changes their shares as little as it moves."""
    others = placed(np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([0, 1]))
    shares = []
    for place in np.linspace(-0.04, 0.04, 81):
        source = placed(np.array([[place, 0.0]]), np.array([9]))
        _, neighbours, _, found = neighbours_of(source, others, CUT, BLOCK_SCANS)
        shares.append(found[neighbours == 0].sum())
    steps = np.diff(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert steps.min() >= 0.0
    assert steps.max() < 2.5e-3 / TIE


def test_a_point_far_outside_costs_no_memory_and_hides_no_neighbour():
    others = placed(np.array([[0.0, 0.0], [1e9, -1e9]]), np.array([0, 1]))
    found = neighbours_of(placed(np.array([[0.5, 0.0]]), np.array([9])), others, CUT, BLOCK_SCANS)
    assert found[1].tolist() == [0]
