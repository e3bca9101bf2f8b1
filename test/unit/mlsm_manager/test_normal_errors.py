"""What comparisons say along a direction that no surface tells."""

import numpy as np
import pytest

from mlsm_manager.joint_solver.weak_directions import discounted

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


def normals_at(angles):
    return np.column_stack([np.cos(angles), np.sin(angles)])


def canal(direction, count=200, seed=0):
    """Return the normals of both walls of a straight canal along `direction` [rad], which err by 0.15 rad."""
    rng = np.random.RandomState(seed)
    sides = rng.choice([-0.5 * np.pi, 0.5 * np.pi], count)
    return normals_at(direction + sides + rng.normal(0.0, 0.15, count))


def along(direction):
    """Return by how much each column changes when the compared scan moves by 1 m along `direction` [rad]."""
    change = np.zeros(COLUMNS)
    change[PLACES[:2]] = normals_at(np.array([direction]))
    return change


def told(information, direction):
    return along(direction) @ information @ along(direction)


def discounted_once(information, gradient):
    found = discounted(information[np.newaxis], gradient[np.newaxis], np.zeros(1, int), PLACES, NORMAL_DEVIATION)
    return found[0][0], found[1][0]


@pytest.mark.parametrize("direction", [0.0, 0.6, 2.0])
def test_straight_walls_say_next_to_nothing_of_the_way_along_them(direction):
    information, gradient = compared(canal(direction))
    found, slope = discounted_once(information, gradient)
    assert told(found, direction) < 0.02 * told(information, direction)
    assert abs(slope @ along(direction)) < 0.1 * abs(gradient @ along(direction)) + 0.1


def test_straight_walls_say_all_of_the_way_across_them():
    information, gradient = compared(canal(0.0))
    found, _ = discounted_once(information, gradient)
    assert told(found, 0.5 * np.pi) == pytest.approx(told(information, 0.5 * np.pi), rel=0.01)


def test_walls_that_face_all_ways_say_nearly_as_much_as_before():
    information, gradient = compared(normals_at(np.random.RandomState(1).uniform(0.0, 2.0 * np.pi, 200)))
    found, _ = discounted_once(information, gradient)
    for direction in np.linspace(0.0, np.pi, 7):
        assert told(found, direction) > 0.85 * told(information, direction)


def test_all_pairs_of_a_scan_together_tell_which_direction_is_weak():
    """One wall is all that some pairs see; the scan as a whole is held by both."""
    pairs = [compared(normals_at(np.full(50, angle))) for angle in (0.0, 0.5 * np.pi)]
    information, gradient = (np.array(parts) for parts in zip(*pairs))
    of_one_scan, _ = discounted(information, gradient, np.zeros(2, int), PLACES, NORMAL_DEVIATION)
    of_two, _ = discounted(information, gradient, np.arange(2), PLACES, NORMAL_DEVIATION)
    assert told(of_one_scan.sum(axis=0), 0.0) > 0.8 * told(information.sum(axis=0), 0.0)
    np.testing.assert_allclose(told(of_two[0], 0.0), told(information[0], 0.0))


def test_what_is_left_is_never_less_than_nothing():
    for seed in range(20):
        normals = normals_at(np.random.RandomState(seed).normal(0.0, 0.05 * seed, 30))
        found, _ = discounted_once(*compared(normals, seed))
        assert np.linalg.eigvalsh(found).min() > -1e-9


def test_normals_without_error_keep_all_information():
    information, gradient = compared(canal(0.3))
    found = discounted(information[np.newaxis], gradient[np.newaxis], np.zeros(1, int), PLACES, 0.0)
    np.testing.assert_array_equal(found[0][0], information)
    np.testing.assert_array_equal(found[1][0], gradient)


def test_no_pairs_give_no_information():
    nothing = np.empty((0, COLUMNS, COLUMNS)), np.empty((0, COLUMNS))
    found = discounted(*nothing, np.empty(0, int), PLACES, NORMAL_DEVIATION)
    assert (found[0].shape, found[1].shape) == (nothing[0].shape, nothing[1].shape)
