"""Further fits of a run and of its parts: to the same path where there are surfaces, and not where all look alike."""

from dataclasses import fields, replace

import numpy as np
import pytest
from made_harbour import tour
from made_models import followed, solver_parameters

from mlsm_manager.joint_solver.batch_solver import solved, solved_part
from mlsm_manager.joint_solver.normal_equations import DELAY, RUN_COLUMNS
from mlsm_manager.offline.refinement import displaced, other_settings, refitted_verdicts
from node_support.geometry import inverse, transformed

pytestmark = [pytest.mark.long, pytest.mark.newest_only("dear; the solver and its parts are tested with every version")]
PITCH = 2.5  # m, hardly more than the cut within which points are compared
WALLS = tour(24, direction=0.12, delay=0.6).scans


def among_furrows(scan, truth, rng):
    """Return a scan whose echoes come from furrows all along x, PITCH apart, which all look alike."""
    places = truth.at(scan.times)
    around = places[:, :2] + rng.uniform(-10.0, 10.0, (len(scan.points), 2))
    echoes = np.column_stack([around[:, 0], np.round(around[:, 1] / PITCH) * PITCH])
    heard = transformed(inverse(places), echoes)
    points = scan.points.copy()
    points[:, :2] = transformed(scan.track.at(scan.times), heard)
    return replace(scan, points=points)


def verdicts_of(scans):
    solver = followed(scans)
    return {verdict.name: verdict for verdict in refitted_verdicts(solver, solved(solver))}


@pytest.fixture(scope="module")
def of_walls():
    return verdicts_of(WALLS)


@pytest.mark.parametrize("name", ["spread over settings", "second start"])
def test_walls_lead_every_fit_to_the_same_path(of_walls, name):
    assert not of_walls[name].fires
    assert of_walls[name].value < 0.2


@pytest.mark.parametrize("seed", range(2))
def test_furrows_that_all_look_alike_lead_from_another_start_to_another_path(seed):
    rng, made = np.random.RandomState(seed), tour(24, direction=0.05)
    found = verdicts_of([among_furrows(scan, made.truth, rng) for scan in made.scans])
    assert found["second start"].fires


def test_the_second_start_lies_a_told_deviation_beside_the_path_and_within_the_cut():
    state = followed(WALLS[:3]).state
    moved = displaced(state, np.array([0.0, 0.5, 1.0, 9.0]), 2.2)
    np.testing.assert_allclose(np.hypot(*(moved.nodes - state.nodes)[:, :2].T), [0.0, 0.5, 1.0, 2.2])


def test_other_settings_differ_from_the_run_s_in_one_thing_each():
    own = solver_parameters()
    for other in other_settings(own):
        assert sum(getattr(other, one.name) != getattr(own, one.name) for one in fields(own)) == 1


FIRST = 8


@pytest.fixture(scope="module")
def part():
    return solved_part(followed(WALLS), FIRST)


def test_it_finds_what_a_run_of_its_scans_alone_finds(part):
    alone = solved(followed(WALLS[FIRST:]))
    np.testing.assert_allclose(part.run, alone.state.run, atol=0.01)
    np.testing.assert_allclose(part.node[2:], alone.state.nodes[-1, 2:], atol=0.005)
    np.testing.assert_allclose(part.covariance[-RUN_COLUMNS:, -RUN_COLUMNS:], alone.run_covariance, rtol=0.1)


def test_it_knows_the_delay_less_well_than_the_whole_run(part):
    whole = solved(followed(WALLS))
    assert part.covariance[-RUN_COLUMNS:, -RUN_COLUMNS:][DELAY, DELAY] > whole.run_covariance[DELAY, DELAY]
