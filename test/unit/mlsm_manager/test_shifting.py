"""Paths of a whole run: how much echoes speak for them, which posts they miss, and shifts that lead to better ones."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_harbour import CANAL, along_canal, tour
from made_models import followed

from mlsm_manager.hovering.echoes import Echoes
from mlsm_manager.hovering.particle_filter import likelihoods_of, nearby_of, on_path
from mlsm_manager.hovering.particles import Particles
from mlsm_manager.hovering.path_agreement import MissedPosts, log_likelihood, shift_gains
from mlsm_manager.hovering.shift_search import ShiftSearch, stretched_mean
from mlsm_manager.joint_solver.batch_solver import fit_path
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.localisation.parameters import EstimatorName, MlsmCoreParameters

ALONG = np.array([1.0, 0.0])
TURN = 16.0  # s; each is one scan here
SCANS = 12
WALL = np.column_stack([np.arange(-60.0, 90.0, 3.0), np.full(50, 12.0)])
POSTS = np.array([[0.0, 5.0], [13.0, -4.0], [31.0, 3.0], [50.0, -6.0]])
TRUE = np.column_stack([3.0 * np.arange(SCANS + 1.0), np.zeros(SCANS + 1)])  # m: on along the wall, 3 m in each turn


def heard(path, far=25.0):
    """Return what a vehicle hears of wall and posts, each scan all at once in the middle between its nodes."""
    parts = []
    for scan, place in enumerate((path[:-1] + path[1:]) / 2.0):
        for places, is_post in ((WALL, False), (POSTS, True)):
            arms = places[np.hypot(*(places - place).T) < far] - place
            count = len(arms)
            parts.append(
                Echoes(
                    np.full(count, scan), arms, np.full(count, 0.5), np.tile([0.0, 1.0], (count, 1)),
                    np.full(count, 3.0 if is_post else 0.4), np.full(count, is_post),
                )
            )  # fmt: skip
    return Echoes.joined(parts)


HEARD = heard(TRUE)


def stray(scan, length):
    """Return the true path shifted by `length` [m] along the wall from a scan on."""
    return TRUE + np.where(np.arange(SCANS + 1) >= scan, length, 0.0)[:, np.newaxis] * ALONG


@given(st.integers(0, 10**6))
@settings(max_examples=10, deadline=None)
def test_a_path_is_worth_what_its_scans_are_worth_one_after_the_other(seed):
    path = TRUE + np.random.RandomState(seed).normal(0.0, 1.0, TRUE.shape)
    total = 0.0
    for scan in range(1, SCANS):
        particle = Particles(path[np.newaxis, : scan + 2], np.zeros((1, 2)), np.zeros(1))
        own, earlier = (HEARD.selected(np.flatnonzero(some)) for some in (HEARD.nodes == scan, HEARD.nodes < scan))
        total += float(likelihoods_of(particle, own, nearby_of(particle, own, earlier))[0])
    assert log_likelihood(HEARD, path) == pytest.approx(total)


@given(st.integers(1, SCANS - 1), st.integers(-20, 20))
@settings(max_examples=10, deadline=None)
def test_a_gain_is_what_the_shifted_path_is_worth_more(scan, length):
    # What is heard just at a node moves as that node does.
    at_nodes = replace(HEARD, shares=np.zeros(len(HEARD)))
    gains = shift_gains(at_nodes, TRUE, ALONG, np.array([-20.0, length, 20.0]))
    expected = log_likelihood(at_nodes, stray(scan, length)) - log_likelihood(at_nodes, TRUE)
    assert gains[scan, 1] == pytest.approx(expected)


def test_the_greatest_gain_takes_back_what_went_wrong():
    lengths = np.arange(-30.0, 31.0)
    gains = shift_gains(HEARD, stray(6, 11.0), ALONG, lengths)
    scan, number = np.unravel_index(np.argmax(gains), gains.shape)
    assert (abs(scan - 6) <= 1, lengths[number]) == (True, -11.0)


def test_on_the_true_path_nothing_is_missed():
    assert MissedPosts(HEARD, 1).cost(TRUE) == 0.0


def test_a_post_that_was_passed_unheard_is_missed():
    post = heard(TRUE[:2]).selected(np.array([-1]))
    assert post.post.all()
    wall = HEARD.selected(np.flatnonzero(~HEARD.post))
    missed = MissedPosts(Echoes.joined([wall, post]), 1).cost(TRUE)
    assert 1.0 < missed < post.weights.sum()


def test_a_post_behind_a_wall_is_not_missed():
    behind = replace(heard(TRUE[:2]).selected(np.array([-1])), arms=np.array([[0.0, 20.0]]))
    near = HEARD.selected(np.flatnonzero(~HEARD.post & (HEARD.nodes > 0)))
    assert MissedPosts(Echoes.joined([near, behind]), 1).cost(TRUE) == 0.0


def test_paths_that_went_wrong_twice_are_led_back():
    wrong = stray(4, 14.0) + stray(9, -23.0) - TRUE
    search = ShiftSearch(HEARD, TURN * np.arange(SCANS + 1.0), 1, refit=lambda path: path)
    best = search.climbed([wrong])[0]
    assert np.hypot(*(best.path - TRUE).T).mean() < 1.5
    assert best.log_likelihood > search.judged(wrong).log_likelihood + 10.0


def test_a_path_that_is_too_short_becomes_longer():
    short = TRUE * [0.96, 1.0]
    search = ShiftSearch(HEARD, TURN * np.arange(SCANS + 1.0), 1, refit=lambda path: path)
    found = stretched_mean(search, short)
    assert np.hypot(*(found.path - TRUE).T).mean() < 0.5 * np.hypot(*(short - TRUE).T).mean()
    assert found.log_likelihood > search.judged(short).log_likelihood


def test_a_path_stays_where_fits_of_it_go_wrong():
    search = ShiftSearch(HEARD, TURN * np.arange(SCANS + 1.0), 1, refit=lambda path: path * [0.5, 1.0])
    assert stretched_mean(search, TRUE).path is TRUE


def test_shifts_that_no_vehicle_goes_are_not_tried():
    hundredths, resting = 0.01 * np.arange(SCANS + 1.0), np.zeros(TRUE.shape)
    (only,) = ShiftSearch(HEARD, hundredths, 1, refit=lambda path: path).climbed([resting])
    assert only.path is resting


def test_a_run_that_heard_nothing_stays_as_it_is():
    search = ShiftSearch(HEARD.selected(np.empty(0, dtype=int)), TURN * np.arange(SCANS + 1.0), 1, lambda path: path)
    best = search.climbed([TRUE])[0]
    assert (best.log_likelihood, best.path is TRUE) == (0.0, True)


def test_a_fit_that_takes_steps_for_told_does_not_creep_along_a_canal():
    made = tour(6, path=along_canal, corners=CANAL)
    profile = MlsmCoreParameters(estimator=EstimatorName.JOINT).changed(profile_values(OdometryKind.HEADING))
    live = followed(made.scans, profile.solver_parameters())
    motion = live.log.node_motion(np.arange(len(live.log.node_times)))
    true = made.truth.at(live.log.node_times)[:, :2]
    start = replace(live.state, nodes=on_path(live.state.nodes, true, motion))
    found = motion.poses[:, :2] + fit_path(live, start).nodes[:, :2]
    np.testing.assert_allclose(found - found[0], true - true[0], atol=0.3)
