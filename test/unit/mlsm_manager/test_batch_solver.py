"""The batch solver: loops that it closes, further fits of a run, and fits of its parts."""

from dataclasses import fields

import numpy as np
import pytest
from made_harbour import that_heard, tour
from made_loops import astray, noisy, resumed
from made_models import followed, solver_parameters

from mlsm_manager.joint_solver.batch_solver import LoopClosure, fit_of, solved_part, with_loops_closed
from mlsm_manager.joint_solver.loops import Loop, agreed, loops_of
from mlsm_manager.joint_solver.normal_equations import DELAY, RUN_COLUMNS
from mlsm_manager.joint_solver.places import PlaceCandidate
from mlsm_manager.offline.refinement import displaced, other_settings, refitted_verdicts

pytestmark = pytest.mark.long

RETURNED = slice(26, None)  # nodes of the scans after the deaf ones
RESUMED = 20  # scans


def errors(solver, batch, track, made):
    times = solver.log.node_times[RETURNED]
    found = track.at(times) + batch.state.nodes[RETURNED, :3]
    return np.hypot(*(found - made.truth.at(times))[:, :2].T)


def test_a_vehicle_that_comes_back_far_astray_is_found_by_its_surroundings():
    made = tour(40)
    scans, track = astray(made, np.array([12.0, -6.0]))
    solver = resumed(scans[:RESUMED], solver_parameters(sonar_delay_deviation=1.0))  # so that it closes none itself
    for scan in scans[RESUMED:]:
        solver.add(scan)
    without = fit_of(solver.solution)
    found = with_loops_closed(solver, without)
    assert errors(solver, without, track, made).mean() > 5.0
    assert errors(solver, found.batch, track, made).mean() < 1.0
    assert found.gain > 100.0
    assert "of its echoes fit there" in found.to_mapping()["found"][0]


def test_a_run_that_is_not_astray_has_no_loops():
    solver = followed(tour(40).scans)
    batch = fit_of(solver.solution)
    found = with_loops_closed(solver, batch)
    assert found.batch is batch
    assert found.to_mapping() == LoopClosure(None, [], np.nan).to_mapping() == {"gain": None, "found": []}


def between_walls(made):
    """Return scans of a canal, where every place fits as well as the next."""
    rng = np.random.RandomState(1)
    for scan in made.scans:
        x = made.truth.at(scan.times)[:, 0] + rng.uniform(-20.0, 20.0, len(scan))
        heard = np.column_stack([x, rng.choice([-12.0, 12.0], len(x)) + rng.normal(0.0, 0.1, len(x))])
        yield that_heard(scan, made.truth, heard)


@pytest.mark.parametrize("scans", [noisy(tour(40).scans), between_walls(tour(40))], ids=["noise", "canal"])
def test_noise_and_a_canal_make_no_loops(scans):
    solver = followed(scans)
    assert loops_of(solver.solution.with_state(fit_of(solver.solution).state)) == []


def test_a_loop_that_other_scans_do_not_confirm_is_none():
    def loop(scan, x):
        place = PlaceCandidate(np.array([x, 0.0]), fit=0.9, fit_before=0.1, elsewhere=0.5, reach=5.0)
        return Loop(scan, 1, place)

    alike = [loop(30, 8.0), loop(31, 9.0), loop(33, 8.0)]
    assert agreed([*alike, loop(32, -8.0), loop(50, 8.0)]) == alike
    assert agreed(alike[:2]) == []


PITCH = 2.5  # m, hardly more than the cut within which points are compared
WALLS = tour(24, direction=0.12, delay=0.6).scans


def among_furrows(scan, truth, rng):
    """Return a scan whose echoes come from furrows all along x, PITCH apart, which all look alike."""
    around = truth.at(scan.times)[:, :2] + rng.uniform(-10.0, 10.0, (len(scan), 2))
    echoes = np.column_stack([around[:, 0], np.round(around[:, 1] / PITCH) * PITCH])
    return that_heard(scan, truth, echoes)


def verdicts_of(scans):
    solver = followed(scans)
    return {verdict.name: verdict for verdict in refitted_verdicts(solver.solution, fit_of(solver.solution))}


@pytest.fixture(scope="module")
def of_walls():
    return verdicts_of(WALLS)


@pytest.mark.parametrize("name", ["spread over settings", "second start"])
def test_walls_lead_every_fit_to_the_same_path(of_walls, name):
    assert not of_walls[name].fires
    assert of_walls[name].value < 0.2


def test_furrows_that_all_look_alike_lead_from_another_start_to_another_path():
    rng, made = np.random.RandomState(1), tour(24, direction=0.05)
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
    alone = fit_of(followed(WALLS[FIRST:]).solution)
    np.testing.assert_allclose(part.run, alone.state.run, atol=0.01)
    np.testing.assert_allclose(part.node[2:], alone.state.nodes[-1, 2:], atol=0.005)
    np.testing.assert_allclose(part.covariance[-RUN_COLUMNS:, -RUN_COLUMNS:], alone.run_covariance, rtol=0.1)


def test_it_knows_the_delay_less_well_than_the_whole_run(part):
    whole = fit_of(followed(WALLS).solution)
    assert part.covariance[-RUN_COLUMNS:, -RUN_COLUMNS:][DELAY, DELAY] > whole.run_covariance[DELAY, DELAY]
