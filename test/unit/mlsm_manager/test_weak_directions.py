"""What surfaces say along a direction that they do not tell."""

import numpy as np
import pytest
from made_models import solver_parameters

from mlsm_manager.joint_solver.normal_equations import BEFORE_THE_RUN
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.weak_directions import WeakDirections

MATCHING = solver_parameters(normal_deviation=0.2)
SCANS = 5


def points_with(normals, scans):
    """Return points of `scans` (n,) on surfaces with `normals` (n, 2)."""
    count = len(normals)
    return PlacedPoints(
        scans=np.asarray(scans), places=np.zeros((count, 2)), arms=np.zeros((count, 2)), normals=normals,
        slants=np.zeros(count), qualities=np.ones(count), shares=np.zeros(count), by_run=np.zeros((count, 2, 2)),
    )  # fmt: skip


def normals_at(angles):
    return np.column_stack([np.cos(angles), np.sin(angles)])


def canal(direction, error=0.15, per_scan=40, first=0, seed=0):
    """Return points on both walls of a straight canal along `direction` [rad], whose normals err by `error` [rad]."""
    rng = np.random.RandomState(seed)
    scans = np.repeat(first + np.arange(SCANS), per_scan)
    sides = rng.choice([-0.5 * np.pi, 0.5 * np.pi], len(scans))
    return points_with(normals_at(direction + sides + rng.normal(0.0, error, len(scans))), scans)


def told_by(points, matching=MATCHING):
    return WeakDirections.of([points], matching).without(points, points.scans)


@pytest.mark.parametrize("direction", [0.0, 0.6, 2.0])
def test_straight_walls_say_nothing_of_the_way_along_them(direction):
    told = told_by(canal(direction))
    along = told.normals @ normals_at(np.array([direction]))[0]
    assert np.abs(along).max() < 0.03


def test_straight_walls_say_all_of_the_way_across_them():
    points = canal(0.0)
    told = told_by(points)
    np.testing.assert_allclose(told.normals[:, 1], np.sign(points.normals[:, 1]), atol=0.01)
    np.testing.assert_array_equal(told.qualities, points.qualities)


def test_bulges_that_travel_along_a_wall_say_nothing_of_the_way_along_it():
    points = canal(0.0)
    points.normals[::20] = normals_at(np.full(len(points.normals[::20]), 0.9))
    assert np.abs(told_by(points).normals[:, 0]).max() < 0.03


def test_a_few_echoes_that_face_along_a_canal_do_not_count():
    points = canal(0.0)
    points.normals[::40] = [1.0, 0.0]
    told = told_by(points)
    np.testing.assert_array_equal(told.qualities[::40], 0.0)


def test_a_wall_that_closes_a_canal_tells_the_way_along_it():
    points = canal(0.0)
    points.normals[::3] = [1.0, 0.0]
    np.testing.assert_array_equal(told_by(points).normals, points.normals)


def test_walls_that_face_all_ways_say_as_much_as_before():
    angles = np.random.RandomState(1).uniform(0.0, 2.0 * np.pi, 200)
    points = points_with(normals_at(angles), np.repeat(np.arange(SCANS), 40))
    np.testing.assert_array_equal(told_by(points).normals, points.normals)


def test_scans_around_a_scan_tell_with_it_which_direction_is_weak():
    """The normals of a single scan may err together."""
    points = canal(0.0, error=0.0)
    middle = points.scans == SCANS // 2
    points.normals[middle] = normals_at(np.arctan2(*points.normals[middle].T[::-1]) + 0.1)
    found = WeakDirections.of([points], MATCHING)
    assert abs(found.directions[SCANS // 2, 1]) < 0.03


def test_scans_along_one_canal_have_one_direction():
    """By so much as two scans differ, what is told across the canal would tell the way along it."""
    found = WeakDirections.of([canal(0.3)], MATCHING)
    np.testing.assert_allclose(found.directions, found.directions[:1].repeat(SCANS, axis=0), atol=1e-12)


def test_scans_far_from_a_scan_do_not_say_what_it_tells():
    parts = canal(0.0), canal(0.5 * np.pi, first=100)
    found = WeakDirections.of(parts, MATCHING)
    for part, axis in zip(parts, (0, 1)):
        told = found.without(part, part.scans)
        assert np.abs(told.normals[:, axis]).max() < 0.03


def test_surfaces_of_a_map_from_before_the_run_are_told_by_the_scans_compared_with_them():
    points = canal(0.0)
    known = points_with(canal(0.0, seed=1).normals, np.full(len(points), BEFORE_THE_RUN))
    told = WeakDirections.of([points, known], MATCHING).without(known, points.scans)
    assert np.abs(told.normals[:, 0]).max() < 0.03


def test_normals_without_error_stay_as_they_are():
    points = canal(0.3)
    assert told_by(points, solver_parameters(normal_deviation=0.0)) is points


def test_no_points_have_no_weak_direction():
    nothing = points_with(np.empty((0, 2)), np.empty(0, dtype=np.int64))
    assert len(told_by(nothing)) == 0
