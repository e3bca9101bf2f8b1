"""Whole paths of a vehicle that strafes: judged by echoes and missed posts, shifted, stretched and fitted."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_harbour import CANAL, along_canal, tour
from made_models import followed

from mlsm_manager.hovering.best_fit import ShiftSearch, stretched_mean
from mlsm_manager.hovering.compiled_particles import Echoes
from mlsm_manager.hovering.particle_filter import likelihoods_of, nearby_of, on_path
from mlsm_manager.hovering.particles import Particles
from mlsm_manager.hovering.path_agreement import MissedPosts, log_likelihood, shift_gains
from mlsm_manager.joint_solver.batch_solver import fit_of, fit_path
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.localisation.parameters import EstimatorName, MlsmCoreParameters

ALONG_WALL = np.array([1.0, 0.0])
TURN = 16.0  # s; each is one scan here
SCANS = 12
WALL = np.column_stack([np.arange(-60.0, 90.0, 3.0), np.full(50, 12.0)])
POSTS = np.array([[0.0, 5.0], [13.0, -4.0], [31.0, 3.0], [50.0, -6.0]])
TRUE = np.column_stack([3.0 * np.arange(SCANS + 1.0), np.zeros(SCANS + 1)])  # m: on along the wall, 3 m in each turn


def heard(path, far=25.0):
    """Return what a vehicle hears of wall and posts, each scan all at once in the middle between its nodes."""
    known, are_posts = np.vstack([WALL, POSTS]), np.arange(len(WALL) + len(POSTS)) >= len(WALL)
    arms = known - (path[:-1] + path[1:])[:, np.newaxis] / 2.0
    scans, places = np.nonzero(np.hypot(*arms.transpose(2, 0, 1)) < far)
    post, normals = are_posts[places], np.tile([0.0, 1.0], (len(scans), 1))
    return Echoes(scans, arms[scans, places], np.full(len(scans), 0.5), normals, np.where(post, 3.0, 0.4), post)


HEARD = heard(TRUE)
OF_WALL = HEARD.selected(np.flatnonzero(~HEARD.post))
LAST_POST = heard(TRUE[:2]).selected(np.array([-1]))


def stray(scan, length):
    """Return the true path shifted by `length` [m] along the wall from a scan on."""
    return TRUE + np.outer(np.arange(SCANS + 1) >= scan, length * ALONG_WALL)


def search(refit=lambda path: path, echoes=HEARD, turn=TURN):
    return ShiftSearch(echoes, turn * np.arange(SCANS + 1.0), 1, refit)


def off(path):
    return np.hypot(*(path - TRUE).T).mean()


@given(st.integers(0, 10**6))
@settings(max_examples=10)
def test_a_path_is_worth_what_its_scans_are_worth_one_after_the_other(seed):
    path = TRUE + np.random.RandomState(seed).normal(0.0, 1.0, TRUE.shape)
    total = 0.0
    for scan in range(1, SCANS):
        particle = Particles(path[np.newaxis, : scan + 2], np.zeros((1, 2)), np.zeros(1))
        own, earlier = (HEARD.selected(np.flatnonzero(some)) for some in (HEARD.nodes == scan, HEARD.nodes < scan))
        total += float(likelihoods_of(particle, own, nearby_of(particle, own, earlier))[0])
    assert log_likelihood(HEARD, path) == pytest.approx(total)


@given(st.integers(1, SCANS - 1), st.integers(-20, 20))
@settings(max_examples=10)
def test_a_gain_is_what_the_shifted_path_is_worth_more(scan, length):
    # What is heard just at a node moves as that node does.
    at_nodes = HEARD._replace(shares=np.zeros(HEARD.size))
    gains = shift_gains(at_nodes, TRUE, ALONG_WALL, np.array([-20.0, length, 20.0]))
    expected = log_likelihood(at_nodes, stray(scan, length)) - log_likelihood(at_nodes, TRUE)
    assert gains[scan, 1] == pytest.approx(expected)


def test_the_greatest_gain_takes_back_what_went_wrong():
    lengths = np.arange(-30.0, 31.0)
    gains = shift_gains(HEARD, stray(6, 11.0), ALONG_WALL, lengths)
    scan, number = np.unravel_index(np.argmax(gains), gains.shape)
    assert (abs(scan - 6) <= 1, lengths[number]) == (True, -11.0)


def test_on_the_true_path_nothing_is_missed():
    assert MissedPosts(HEARD, 1).cost(TRUE) == 0.0


def test_a_post_that_was_passed_unheard_is_missed():
    assert LAST_POST.post.all()
    assert 1.0 < MissedPosts(Echoes.joined([OF_WALL, LAST_POST]), 1).cost(TRUE) < LAST_POST.weights.sum()


def test_a_post_behind_a_wall_is_not_missed():
    behind = LAST_POST._replace(arms=np.array([[0.0, 20.0]]))
    near = OF_WALL.selected(OF_WALL.nodes > 0)
    assert MissedPosts(Echoes.joined([near, behind]), 1).cost(TRUE) == 0.0


@pytest.mark.long
def test_paths_that_went_wrong_twice_are_led_back():
    wrong = stray(4, 14.0) + stray(9, -23.0) - TRUE
    best = search().climbed([wrong])[0]
    assert off(best.path) < 1.5
    assert best.log_likelihood > search().judged(wrong).log_likelihood + 10.0


def test_a_path_that_is_too_short_becomes_longer():
    short = TRUE * [0.96, 1.0]
    found = stretched_mean(search(), short)
    assert off(found.path) < 0.5 * off(short)
    assert found.log_likelihood > search().judged(short).log_likelihood


def test_a_path_stays_where_fits_of_it_go_wrong():
    assert stretched_mean(search(refit=lambda path: path * [0.5, 1.0]), TRUE).path is TRUE


def test_shifts_that_no_vehicle_goes_are_not_tried():
    at_rest = np.zeros(TRUE.shape)
    (only,) = search(turn=0.01).climbed([at_rest])
    assert only.path is at_rest


def test_a_run_that_heard_nothing_stays_as_it_is():
    best = search(echoes=HEARD.selected(np.empty(0, dtype=int))).climbed([TRUE])[0]
    assert (best.log_likelihood, best.path is TRUE) == (0.0, True)


@pytest.fixture(scope="module")
def in_canal():
    """A live solver in a canal, the unknowns on its true path, and the places of that (n, 2)."""
    made = tour(6, path=along_canal, corners=CANAL)
    profile = MlsmCoreParameters(estimator=EstimatorName.JOINT).changed(profile_values(OdometryKind.HEADING))
    live = followed(made.scans, profile.solver_parameters())
    motion = live.log.node_motion(np.arange(len(live.log.node_times)))
    true = made.truth.at(live.log.node_times)[:, :2]
    return live, replace(live.state, nodes=on_path(live.state.nodes, true, motion)), true


def test_a_fit_that_takes_steps_for_told_does_not_creep_along_a_canal(in_canal):
    live, start, true = in_canal
    found = live.solution.with_state(fit_path(live, start)).node_places(np.arange(len(true)))
    np.testing.assert_allclose(found - found[0], true - true[0], atol=0.3)


def test_steps_that_a_fit_takes_for_told_make_nothing_known_along_a_canal(in_canal):
    live, start, _ = in_canal
    along = fit_of(live.solution.with_state(start), fixed_steps=start).pose_covariances[-1, 0, 0]
    assert np.sqrt(along) > 2.0  # six steps of 0.3 m each are 0.7 m
