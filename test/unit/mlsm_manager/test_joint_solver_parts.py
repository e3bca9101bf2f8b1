"""Parts of the joint solver: parts of a turn, points, weights that fade out, the bounded frozen map."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_harbour import logged, tour
from made_models import DVL, solution_of, solver_parameters, some_state
from made_posts import heard

from mlsm_manager.joint_solver.comparisons import comparisons_of
from mlsm_manager.joint_solver.estimate import LiveEstimate
from mlsm_manager.joint_solver.normal_equations import NormalEquations, Residuals, dense_solution, sparse_solution
from mlsm_manager.joint_solver.odometry_log import GrowingArray, OdometryLog
from mlsm_manager.joint_solver.run_log import parts_of, stacked, unstacked
from mlsm_manager.joint_solver.surface_points import points_per_echo, reaches, surface_normals
from mlsm_manager.joint_solver.window import fading, joint_covariance, nearest_groups
from mlsm_manager.scan_matching.scan import Track


@pytest.fixture(scope="module")
def log():
    return logged(tour(3, direction=0.1, delay=0.3).scans)


def placed_in(log, state):
    return solution_of(log, DVL, state).placed(log.surfaces.heard(0, 3))


def test_a_point_is_compared_with_another_scan_of_its_own_block(log):
    placed = placed_in(log, some_state(log))
    ((pairs, _, _),) = comparisons_of(placed, [placed], 2.0, 5, solver_parameters().min_cosine)
    assert len(pairs.rows) > 100
    assert (placed.scans[pairs.rows] != placed.scans[pairs.neighbours]).all()


@pytest.mark.parametrize("unknown", range(2))
def test_places_follow_the_run_s_unknowns_as_their_derivatives_say(log, unknown):
    state, step = some_state(log), 0.01  # delays within one step of the odometry: its path is a polygon
    placed = placed_in(log, state)
    state.run[unknown] += step
    change = (placed_in(log, state).places - placed.places) / step
    np.testing.assert_allclose(change, placed.by_run[..., unknown], atol=0.5)
    np.testing.assert_allclose(np.median(np.abs(change - placed.by_run[..., unknown])), 0.0, atol=0.03)


@given(st.lists(st.floats(0.0, 1e3), min_size=1, max_size=60), st.integers(1, 20))
def test_at_most_so_many_blocks_count(distances, most):
    factors = fading(np.array(distances), most)
    assert (factors > 0.0).sum() <= most or len(distances) <= most
    assert ((factors >= 0.0) & (factors <= 1.0)).all()


def test_a_scan_is_compared_with_the_nearest_groups_only(log):
    few = replace(solver_parameters(), scans_per_group=1, frozen_scans=2)
    near = nearest_groups(replace(solution_of(log, DVL, some_state(log)), parameters=few), 3)
    assert 1 <= len(near.numbers) <= 2
    assert set(near.points.scans) == set(near.numbers)
    assert len(near.importance) == len(near.points)


def test_a_vehicle_that_stays_keeps_blocks_to_compare_with():
    assert (fading(np.full(50, 3.0) + 5.0 * np.arange(50) / 50, 20) > 0.0).sum() >= 15


def test_a_block_fades_out_before_it_is_left_out():
    distances = np.arange(1.0, 12.0)
    np.testing.assert_allclose(fading(distances, 5), fading(distances + 1e-9, 5), atol=1e-8)


@given(st.lists(st.floats(0.01, 9.0), min_size=1, max_size=8))
def test_frozen_places_have_a_covariance_that_is_possible(deviations):
    covariances = np.array([np.diag([d**2, d**2, 1e-4]) for d in deviations])
    joint = joint_covariance(covariances)
    np.testing.assert_allclose(joint[:3, :3], covariances[0], rtol=1e-9)
    assert np.linalg.eigvalsh(joint).min() > -1e-9 * joint.max()


def test_dense_and_sparse_solutions_agree():
    rng = np.random.RandomState(5)
    equations = NormalEquations(8)
    columns = rng.randint(0, 8, (40, 3))
    equations.add(Residuals(columns, rng.normal(size=(40, 3)), rng.normal(size=40), rng.uniform(0.5, 2.0, 40)))
    np.testing.assert_allclose(dense_solution(equations).step, sparse_solution(equations).step, rtol=1e-6)


def test_an_error_of_what_is_held_passes_on_to_what_hangs_on_it():
    equations = NormalEquations(1, held=1)
    equations.add(Residuals(np.array([[0, 1]]), np.array([[1.0, -1.0]]), np.zeros(1), np.array([4.0])))
    solution = dense_solution(equations)
    assert solution.covariances(np.array([[0]]), np.array([[9.0]]))[0][0, 0, 0] == pytest.approx(0.25 + 9.0)


WALL = np.column_stack([np.full(30, 10.0), np.linspace(-6.0, 6.0, 30)])


def test_the_normal_of_a_wall_is_square_to_it():
    normals, qualities = surface_normals(WALL, np.full(30, 2.3))
    np.testing.assert_allclose(np.abs(normals[:, 0]), 1.0, atol=1e-9)
    assert qualities.min() > 0.9


def test_a_coarse_head_s_points_on_a_far_wall_are_still_a_surface():
    bearings = np.radians(3.0) * np.arange(-8, 9)
    far = 40.0 * np.column_stack([np.ones(17), np.tan(bearings)])
    reach = reaches(np.arange(17.0), bearings, np.hypot(*far.T))
    assert surface_normals(far, reach)[1][4:13].min() == 1.0


def test_a_beam_that_heard_nothing_does_not_change_the_reach():
    bearings = np.radians(3.0) * np.arange(40)
    heard = np.delete(np.arange(40), [5, 6, 21])
    whole = reaches(np.arange(40.0), bearings, np.full(40, 30.0))
    np.testing.assert_allclose(reaches(heard * 1.0, bearings[heard], np.full(37, 30.0)), whole[heard])


def test_points_all_along_one_echo_share_its_weight():
    times, ranges = np.array([2.0, 1.0, 2.0, 2.0, 1.0, 2.0]), np.array([11.0, 5.0, 10.0, 12.0, 40.0, 30.0])
    np.testing.assert_array_equal(points_per_echo(times, ranges), [3.0, 1.0, 3.0, 3.0, 1.0, 1.0])


FIRST, SECOND = heard(2)


def drawn_along(scan, points):
    """Return a scan in which each echo is so many points, a metre apart along the beam."""
    sights = scan.points * [1.0, 1.0, 0.0, 0.0]
    metre = sights / np.hypot(*sights[:, :2].T)[:, np.newaxis]
    places = np.concatenate([scan.points + step * metre for step in range(points)])
    return replace(scan, points=places, times=np.tile(scan.times, points), moving=np.tile(scan.moving, points))


def test_echoes_that_are_drawn_as_several_points_are_plateaus_whose_scale_is_less_certain_unless_it_is_calibrated():
    peaks, plateaus = logged([FIRST, SECOND]), logged([drawn_along(scan, 3) for scan in (FIRST, SECOND)])
    assert [log.has_plateaus for log in (logged([]), peaks, plateaus)] == [False, False, True]
    unknown, calibrated = solver_parameters(), solver_parameters(plateau_scale_deviation=0.0)
    assert [unknown.run_deviations(log)[0] for log in (peaks, plateaus)] == [0.02, 0.03]
    assert [calibrated.run_deviations(log)[0] for log in (peaks, plateaus)] == [0.02, 0.02]


def test_a_scan_that_is_taken_back_and_a_run_that_begins_later_do_not_count():
    log = logged([FIRST, drawn_along(SECOND, 6)])
    assert (log.has_plateaus, log.since(1).has_plateaus) == (True, True)
    log.shorten(1)
    assert not log.has_plateaus


@given(st.lists(st.tuples(st.integers(0, 3), st.floats(0.0, 50.0)), max_size=20), st.randoms())
def test_points_per_echo_do_not_depend_on_their_order(points, random):
    shuffled = points[:]
    random.shuffle(shuffled)
    counts = [
        dict(zip(one, points_per_echo(*np.array(one, dtype=float).reshape(-1, 2).T))) for one in (points, shuffled)
    ]
    assert counts[0].keys() == counts[1].keys()
    np.testing.assert_allclose([counts[0][point] for point in points], [counts[1][point] for point in points])


def test_a_heap_of_points_is_no_surface():
    heap = np.random.RandomState(0).normal(0.0, 0.3, (10, 2))
    assert surface_normals(heap, np.full(10, 2.3))[1].max() < 0.6


def test_qualities_do_not_jump_when_points_move_a_little():
    points = WALL + np.random.RandomState(4).normal(0.0, 0.5, (30, 2))
    nudged = points + np.random.RandomState(6).choice([-1e-9, 1e-9], points.shape)
    before, after = (surface_normals(some, np.full(30, 2.3))[1] for some in (points, nudged))
    np.testing.assert_allclose(before, after, atol=1e-6)


def test_normals_point_away_from_the_sonar(log):
    points, _ = log.surfaces.heard(0, 3)
    sight = np.column_stack([np.cos(points.bearings), np.sin(points.bearings)])
    assert (np.einsum("na,na->n", sight, points.normals) > 0.0).all()


@given(st.lists(st.integers(0, 400), max_size=6))
def test_an_array_keeps_what_was_appended(counts):
    grown, expected = GrowingArray(2), np.empty((0, 2))
    for number, count in enumerate(counts):
        rows = np.full((count, 2), float(number))
        grown.extend(rows)
        expected = np.vstack([expected, rows])
    np.testing.assert_array_equal(grown.values, expected)


def test_tracks_that_overlap_make_one_path_without_a_turn_in_its_yaw():
    whole = OdometryLog()
    whole.extend(Track(np.arange(0.0, 5.0), np.column_stack([np.arange(5.0), np.zeros(5), np.full(5, 3.1)])), 3.0)
    whole.extend(Track(np.arange(2.0, 8.0), np.column_stack([np.arange(2.0, 8.0), np.zeros(6), np.full(6, -3.1)])), 9.0)
    np.testing.assert_allclose(whole.at(np.array([1.0, 3.5, 6.5]))[:, 0], [1.0, 3.5, 6.5])
    assert np.ptp(whole.at(np.arange(0.0, 7.0, 0.5))[:, 2]) < 0.2


def test_a_run_without_estimates_stores_none():
    assert unstacked(LiveEstimate, stacked([], "a."), "a.") == []


def test_every_point_is_in_the_part_of_its_time():
    parts = parts_of(SECOND, 3, FIRST.reference_time)
    assert sum(len(part) for part in parts) == len(SECOND)
    assert all(part.times.max() <= part.reference_time for part in parts)
    assert all(later.times.min() > earlier.reference_time for earlier, later in zip(parts, parts[1:]))


@pytest.mark.parametrize("turn", [SECOND, SECOND.without_points(SECOND.reference_time)], ids=["heard", "deaf"])
@pytest.mark.parametrize("newest", [None, FIRST.reference_time])
def test_parts_last_equally_long_and_end_with_the_turn(turn, newest):
    ends = [part.reference_time for part in parts_of(turn, 4, newest)]
    np.testing.assert_allclose(np.diff(ends), np.diff(ends)[0])
    assert np.diff(ends)[0] > 0.0
    assert (len(ends), ends[-1]) == (4, SECOND.reference_time)


def test_a_turn_after_a_silence_is_cut_where_it_was_heard():
    parts = parts_of(SECOND, 3, SECOND.start - 100.0)
    assert min(len(part) for part in parts) > 0.2 * len(SECOND)


def test_one_part_is_the_scan_itself():
    assert parts_of(SECOND, 1, None)[0] is SECOND
