"""Walls that are nearly parallel give no information about motion along them."""

import numpy as np
import pytest
from made_models import points_of, solver_parameters

from mlsm_manager.joint_solver.normal_equations import BEFORE_THE_RUN
from mlsm_manager.joint_solver.weak_directions import WeakDirections, discounted

MATCHING = solver_parameters(normal_deviation=0.2)
SCANS = 5


def normals_at(angles):
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def canal_normals(direction, error=0.15, seed=0):
    """Return the normals of both walls of a straight canal along `direction` [rad], which err by `error` [rad]."""
    rng = np.random.RandomState(seed)
    sides = rng.choice([-0.5 * np.pi, 0.5 * np.pi], 40 * SCANS)
    return normals_at(direction + sides + rng.normal(0.0, error, 40 * SCANS))


CLOSED = np.where(np.arange(40 * SCANS)[:, np.newaxis] % 3, canal_normals(0.0), [1.0, 0.0])
ALL_WAYS = normals_at(np.random.RandomState(1).uniform(0.0, 2.0 * np.pi, 40 * SCANS))


def canal(direction, error=0.15, first=0, seed=0):
    """Return points on such walls."""
    return points_of(np.repeat(first + np.arange(SCANS), 40), normals=canal_normals(direction, error, seed))


def counted(points, matching=MATCHING):
    return WeakDirections.of([points], matching).without(points, points.scans)


@pytest.mark.parametrize("direction", [0.0, 0.6, 2.0])
def test_straight_walls_say_nothing_of_the_way_along_them(direction):
    along = counted(canal(direction)).normals @ normals_at(direction)
    assert np.abs(along).max() < 0.03


def test_straight_walls_say_all_of_the_way_across_them():
    points = canal(0.0)
    counting = counted(points)
    np.testing.assert_allclose(counting.normals[:, 1], np.sign(points.normals[:, 1]), atol=0.01)
    np.testing.assert_array_equal(counting.qualities, points.qualities)


def test_bulges_that_travel_along_a_wall_say_nothing_of_the_way_along_it():
    points = canal(0.0)
    points.normals[::20] = normals_at(0.9)
    assert np.abs(counted(points).normals[:, 0]).max() < 0.03


def test_a_few_echoes_that_face_along_a_canal_do_not_count():
    points = canal(0.0)
    points.normals[::40] = [1.0, 0.0]
    np.testing.assert_array_equal(counted(points).qualities[::40], 0.0)


@pytest.mark.parametrize("normals", [CLOSED, ALL_WAYS], ids=["a wall closes the canal", "walls face all ways"])
def test_walls_that_tell_every_way_say_as_much_as_before(normals):
    points = points_of(np.repeat(np.arange(SCANS), 40), normals=normals)
    np.testing.assert_array_equal(counted(points).normals, normals)


def test_scans_around_a_scan_tell_with_it_which_direction_is_weak():
    """The normals of a single scan may err together."""
    points = canal(0.0, error=0.0)
    middle = points.scans == SCANS // 2
    points.normals[middle] = normals_at(np.arctan2(*points.normals[middle].T[::-1]) + 0.1)
    found = WeakDirections.of([points], MATCHING)
    assert abs(found.directions[SCANS // 2, 1]) < 0.03


def test_scans_along_one_canal_have_one_direction():
    """By so much as two scans differ, what is counting across the canal would tell the way along it."""
    found = WeakDirections.of([canal(0.3)], MATCHING)
    np.testing.assert_allclose(found.directions, found.directions[:1].repeat(SCANS, axis=0), atol=1e-12)


def test_scans_far_from_a_scan_do_not_say_what_it_tells():
    parts = canal(0.0), canal(0.5 * np.pi, first=100)
    found = WeakDirections.of(parts, MATCHING)
    for part, axis in zip(parts, (0, 1)):
        counting = found.without(part, part.scans)
        assert np.abs(counting.normals[:, axis]).max() < 0.03


def test_surfaces_of_a_map_from_before_the_run_are_told_by_the_scans_compared_with_them():
    points = canal(0.0)
    known = points_of(np.full(len(points), BEFORE_THE_RUN), normals=canal(0.0, seed=1).normals)
    counting = WeakDirections.of([points, known], MATCHING).without(known, points.scans)
    assert np.abs(counting.normals[:, 0]).max() < 0.03


def test_normals_without_error_stay_as_they_are():
    points = canal(0.3)
    assert counted(points, solver_parameters(normal_deviation=0.0)) is points


def test_no_points_have_no_weak_direction():
    nothing = points_of(np.empty(0, dtype=np.int64))
    assert len(counted(nothing)) == 0


PLACES = np.array([[0, 1], [3, 4], [6, 7], [9, 10]])
COLUMNS = 14
NORMAL_DEVIATION = 0.15


def compared(normals, seed=0):
    """Return information and gradient of one pair of scans with points on surfaces with `normals` (n, 2)."""
    rng = np.random.RandomState(seed)
    late, later = rng.rand(2, len(normals), 1)
    yaw = rng.normal(0.0, 5.0, (4, len(normals), 1))
    parts = [(1.0 - late) * normals, yaw[0], late * normals, yaw[1]]
    parts += [-(1.0 - later) * normals, yaw[2], -later * normals, yaw[3], np.zeros((len(normals), 2))]
    jacobian = np.hstack(parts)
    return jacobian.T @ jacobian, jacobian.T @ rng.normal(0.0, 0.1, len(normals))


def along(direction):
    """Return by how much each column changes when the compared scan moves by 1 m along `direction` [rad]."""
    change = np.zeros(COLUMNS)
    change[PLACES[:2]] = normals_at(direction)
    return change


def counting(information, direction):
    return along(direction) @ information @ along(direction)


def discounted_once(information, gradient, normal_deviation=NORMAL_DEVIATION):
    found = discounted(information[np.newaxis], gradient[np.newaxis], np.zeros(1, int), PLACES, normal_deviation)
    return found[0][0], found[1][0]


@pytest.mark.parametrize("direction", [0.0, 0.6, 2.0])
def test_straight_walls_say_next_to_nothing_of_the_way_along_them(direction):
    information, gradient = compared(canal_normals(direction))
    found, slope = discounted_once(information, gradient)
    assert counting(found, direction) < 0.02 * counting(information, direction)
    assert abs(slope @ along(direction)) < 0.1 * abs(gradient @ along(direction)) + 0.1


def test_comparisons_with_straight_walls_say_all_of_the_way_across_them():
    information, gradient = compared(canal_normals(0.0))
    found, _ = discounted_once(information, gradient)
    assert counting(found, 0.5 * np.pi) == pytest.approx(counting(information, 0.5 * np.pi), rel=0.01)


def test_walls_that_face_all_ways_say_nearly_as_much_as_before():
    information, gradient = compared(ALL_WAYS)
    found, _ = discounted_once(information, gradient)
    for direction in np.linspace(0.0, np.pi, 7):
        assert counting(found, direction) > 0.85 * counting(information, direction)


def test_all_pairs_of_a_scan_together_tell_which_direction_is_weak():
    """One wall is all that some pairs see; the scan as a whole is held by both."""
    pairs = [compared(normals_at(np.full(50, angle))) for angle in (0.0, 0.5 * np.pi)]
    information, gradient = (np.array(parts) for parts in zip(*pairs))
    of_one_scan, _ = discounted(information, gradient, np.zeros(2, int), PLACES, NORMAL_DEVIATION)
    of_two, _ = discounted(information, gradient, np.arange(2), PLACES, NORMAL_DEVIATION)
    assert counting(of_one_scan.sum(axis=0), 0.0) > 0.8 * counting(information.sum(axis=0), 0.0)
    np.testing.assert_allclose(counting(of_two[0], 0.0), counting(information[0], 0.0))


def test_what_is_left_is_never_less_than_nothing():
    for seed in range(20):
        normals = normals_at(np.random.RandomState(seed).normal(0.0, 0.05 * seed, 30))
        found, _ = discounted_once(*compared(normals, seed))
        assert np.linalg.eigvalsh(found).min() > -1e-9


def test_normals_without_error_keep_all_information():
    information, gradient = compared(canal_normals(0.3))
    found, slope = discounted_once(information, gradient, normal_deviation=0.0)
    np.testing.assert_array_equal(found, information)
    np.testing.assert_array_equal(slope, gradient)


def test_no_pairs_give_no_information():
    nothing = np.empty((0, COLUMNS, COLUMNS)), np.empty((0, COLUMNS))
    found = discounted(*nothing, np.empty(0, int), PLACES, NORMAL_DEVIATION)
    assert (found[0].shape, found[1].shape) == (nothing[0].shape, nothing[1].shape)
