"""A run finds itself in a map that was there before it."""

from dataclasses import replace

import numpy as np
import pytest
from made_harbour import tour
from made_models import solver_parameters

from mlsm_manager.joint_solver.comparisons import Pairs
from mlsm_manager.joint_solver.known_surfaces import KnownSurfaces
from mlsm_manager.joint_solver.live_solver import LiveSolver
from node_support.geometry import transformed

HARBOUR = tour(4)
PARAMETERS = solver_parameters(sonar_delay_deviation=0.01)
SONAR = np.array([0.3, 0.0])


def known_places():
    return np.concatenate([scan.points[:, :2] for scan in tour(4, seed=1).scans])


def pairs_with(known):
    solver = LiveSolver(PARAMETERS, SONAR)
    solver.add(HARBOUR.scans[0])
    sources = solver.solution.placed(solver.log.rows(0, 1))
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
    solver = LiveSolver(PARAMETERS, SONAR, start=np.array([1.0, 1.0, 0.05]), known=known)
    for scan in HARBOUR.scans:
        estimate = solver.add(scan)
    np.testing.assert_allclose(estimate.T_map_base - estimate.T_odom_base, shift, atol=0.1)


def test_a_run_in_a_known_map_goes_on_when_its_first_scans_are_frozen():
    parameters = replace(PARAMETERS, free_scans=2)
    solver = LiveSolver(parameters, SONAR, start=np.array([1.0, 1.0, 0.05]), known=KnownSurfaces(known_places()))
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
