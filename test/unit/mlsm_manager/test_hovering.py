"""Vehicles that strafe: particles drawn, led to posts and weighed, and whole paths judged and shifted."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_harbour import CANAL, along_canal, tour
from made_models import followed

from mlsm_manager.hovering.best_fit import ShiftSearch, stretched_mean
from mlsm_manager.hovering.compiled_particles import Echoes
from mlsm_manager.hovering.particle_filter import (
    FADING,
    groups_of,
    likelihoods_of,
    nearby_of,
    on_path,
    pulled,
    pulls_of,
    weighed,
)
from mlsm_manager.hovering.particles import ACROSS, ALONG, AROUND, FARTHEST, Particles, drawn, led
from mlsm_manager.hovering.path_agreement import MissedPosts, log_likelihood, shift_gains
from mlsm_manager.joint_solver.batch_solver import fit_of, fit_path
from mlsm_manager.joint_solver.odometry_log import Motion, OdometryLog
from mlsm_manager.joint_solver.velocity_models import AHEAD, ASIDE
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.localisation.parameters import EstimatorName, MlsmCoreParameters
from mlsm_manager.scan_matching.scan import Track

PART = 5.0  # s


def particles_of(seed, count=40):
    rng = np.random.RandomState(seed)
    return Particles(rng.normal(0.0, 2.0, (count, 4, 2)), rng.normal(0.0, 0.3, (count, 2)), rng.normal(size=count))


def resting(count, nodes):
    """Return particles that stay at the origin."""
    return Particles(np.zeros((count, nodes, 2)), np.zeros((count, 2)), np.zeros(count))


def echoes_of(rng, node, count):
    normals = rng.normal(size=(count, 2))
    return Echoes(
        nodes=np.sort(rng.choice(node, count)), arms=rng.normal(0.0, 5.0, (count, 2)), shares=rng.uniform(0, 1, count),
        normals=normals / np.hypot(*normals.T)[:, np.newaxis], weights=rng.uniform(0.1, 3.0, count),
        post=rng.rand(count) < 0.3,
    )  # fmt: skip


def one_post(node, arm, share=0.5):
    """Return a post."""
    return Echoes(
        nodes=np.array([node]), arms=np.array([arm]), shares=np.array([share]), normals=np.array([[1.0, 0.0]]),
        weights=np.array([3.0]), post=np.array([True]),
    )  # fmt: skip


def squared_deviations(offsets, normals, post):
    """Return squared deviations (...) of offsets (..., 2) [m] from targets with `normals` (..., 2)."""
    across = (offsets * normals).sum(axis=-1)
    along = offsets[..., 1] * normals[..., 0] - offsets[..., 0] * normals[..., 1]
    on_surface = (across / ACROSS) ** 2 + (along / ALONG) ** 2
    return np.where(post, (offsets**2).sum(axis=-1) / AROUND**2, on_surface)


def nearest(particles, heard, nearby, source):
    """Return squared deviations (n,), normals (n, 2) and offsets (n, 2) [m] of the target nearest to a source."""
    rows = nearby.rows[nearby.sources == source]
    own = heard.places(particles.paths, int(heard.nodes[0]) - particles.paths.shape[1] + 2)[:, source]
    offsets = nearby.targets.places(particles.paths, 0)[:, rows] - own[:, np.newaxis]
    squared = squared_deviations(offsets, nearby.targets.normals[rows], heard.post[source])
    best, every = squared.argmin(axis=1), np.arange(len(offsets))
    return squared[every, best], nearby.targets.normals[rows][best], offsets[every, best]


def heard_and_nearby(seed, sources, targets, count):
    rng, particles = np.random.RandomState(seed), particles_of(seed, count)
    heard = echoes_of(rng, [7], sources)
    return particles, heard, nearby_of(particles, heard, echoes_of(rng, [0, 1], targets))


def likelihoods(particles, sources, targets):
    return likelihoods_of(particles, sources, nearby_of(particles, sources, targets))


@given(st.integers(0, 10**6), st.integers(1, 30), st.integers(1, 60))
def test_each_source_counts_by_its_nearest_target(seed, sources, targets):
    particles, heard, nearby = heard_and_nearby(seed, sources, targets, count=100)
    expected = np.zeros(100)
    for source in np.unique(nearby.sources):
        squared = nearest(particles, heard, nearby, source)[0]
        expected += heard.weights[source] * np.where(squared < FARTHEST, np.exp(-0.5 * squared), 0.0)
    np.testing.assert_allclose(likelihoods_of(particles, heard, nearby), expected, rtol=1e-9, atol=1e-9)


@given(st.integers(0, 10**6), st.integers(1, 30), st.integers(1, 60))
def test_each_source_pulls_to_its_nearest_target(seed, sources, targets):
    particles, heard, nearby = heard_and_nearby(seed, sources, targets, count=40)
    matrices, forces = np.tile(0.7**-2.0 * np.eye(2), (40, 1, 1)), np.zeros((40, 2))
    for source in np.unique(nearby.sources):
        squared, normals, offsets = nearest(particles, heard, nearby, source)
        fade = np.where(squared < FARTHEST, np.exp(-FADING * squared), 0.0)[:, np.newaxis, np.newaxis]
        across = normals[:, :, np.newaxis] * normals[:, np.newaxis] / ACROSS**2
        information = heard.weights[source] * fade * (np.eye(2) / AROUND**2 if heard.post[source] else across)
        matrices += heard.shares[source] ** 2 * information
        forces += heard.shares[source] * np.einsum("nab,nb->na", information, offsets)
    expected = np.linalg.solve(matrices, forces[..., np.newaxis])[..., 0]
    np.testing.assert_allclose(pulls_of(particles, heard, nearby), expected, rtol=1e-9, atol=1e-9)


def test_some_particles_are_pulled_and_their_speeds_with_them():
    particles = resting(400, 3)
    heard = one_post(1, [5.0, 0.0], 1.0)
    nearby, rng = nearby_of(particles, heard, one_post(0, [6.0, 0.0])), np.random.RandomState(0)
    moved = pulled(particles, heard, nearby, PART, rng)
    assert 100 < (moved.paths[:, -1, 0] > 0.0).sum() < 300
    np.testing.assert_allclose(moved.speeds, moved.paths[:, -1] / PART)


def test_few_particles_far_from_all_others_are_compared_with_what_they_heard_there():
    paths = np.zeros((1000, 3, 2))
    paths[:3, -1] = [60.0, 0.0]
    particles = Particles(paths, np.zeros((1000, 2)), np.zeros(1000))
    heard, earlier = one_post(1, [-30.0, 0.0], 1.0), one_post(0, [30.0, 0.0])
    log_weights = weighed(particles, heard, earlier, PART, np.random.RandomState(0)).log_weights
    np.testing.assert_allclose(log_weights[:3], 0.0)
    assert log_weights[3:].max() < -2.0


def test_particles_that_end_in_one_square_are_one_group():
    groups = groups_of(np.array([[1.0, 1.0], [50.0, 1.0], [2.0, 1.5], [51.0, 2.0], [1.0, 50.0]]))
    assert sorted(sorted(group.tolist()) for group in groups) == [[0, 2], [1, 3], [4]]


def test_a_surface_tells_nothing_to_one_that_faces_the_other_way():
    particles = resting(1, 3)
    wall = one_post(0, [5.0, 0.0])._replace(post=np.array([False]))
    behind = wall._replace(nodes=np.array([1]), normals=-wall.normals)
    assert likelihoods(particles, behind, wall) == 0.0
    assert likelihoods(particles, wall._replace(nodes=np.array([1])), wall) == pytest.approx(3.0)


def test_a_part_of_a_turn_that_heard_nothing_changes_no_weight():
    nothing, particles = one_post(1, [5.0, 0.0]).selected(np.zeros(0, dtype=int)), particles_of(0)
    assert weighed(particles, nothing, one_post(0, [5.0, 0.0]), PART, np.random.RandomState(0)) is particles


def test_some_particles_are_led_to_where_posts_meet():
    rng, particles, far = np.random.RandomState(0), resting(400, 2), np.full((400, 2), 100.0)
    sources, targets = one_post(1, [3.0, 0.0], 1.0), one_post(0, [6.0, 1.0])
    ends, speeds = led(particles, (far, np.zeros((400, 2))), sources, targets, PART, rng)
    moved = ends[:, 0] < 50.0
    assert 50 < moved.sum() < 200
    np.testing.assert_allclose(ends[moved], np.tile([3.0, 1.0], (moved.sum(), 1)), atol=1.5)
    np.testing.assert_allclose(speeds[moved], ends[moved] / PART)


def test_no_particle_is_led_faster_than_a_small_vehicle_goes():
    draw, rng = (np.zeros((400, 2)), np.zeros((400, 2))), np.random.RandomState(0)
    ends, _ = led(resting(400, 2), draw, one_post(1, [3.0, 0.0]), one_post(0, [60.0, 1.0]), PART, rng)
    np.testing.assert_array_equal(ends, np.zeros((400, 2)))


def test_a_speed_is_kept_in_map_or_in_base_link_or_ends():
    particles = Particles(np.zeros((3000, 1, 2)), np.tile([0.6, 0.0], (3000, 1)), np.zeros(3000))
    _, speeds = drawn(particles, PART, np.pi / 2.0, np.random.RandomState(0))
    for kept, least in (([0.6, 0.0], 0.25), ([0.0, 0.6], 0.25), ([0.0, 0.0], 0.08)):
        assert (np.hypot(*(speeds - kept).T) < 0.2).mean() > least


def test_particles_of_one_place_are_drawn_anew_as_often_as_they_weigh():
    rng = np.random.RandomState(1)
    particles = Particles(rng.uniform(0.1, 1.9, (1000, 4, 2)), rng.normal(size=(1000, 2)), np.full(1000, -50.0))
    particles.log_weights[:10] = 0.0
    again = particles.resampled(np.random.RandomState(0))
    assert {tuple(end) for end in again.paths[:, -1]} == {tuple(end) for end in particles.paths[:10, -1]}
    np.testing.assert_allclose(again.log_weights, np.zeros(1000), atol=1e-9)


def test_a_place_of_little_weight_keeps_it_and_more_particles_than_that():
    paths = np.full((1000, 2, 2), 1.0)
    paths[:10, 1] = [31.0, 1.0]
    particles = Particles(paths, np.zeros((1000, 2)), np.where(np.arange(1000) < 10, 0.0, -0.5 * np.arange(1000)))
    particles.log_weights[10] = np.log(990.0)
    again = particles.resampled(np.random.RandomState(0))
    far = again.paths[:, -1, 0] > 30.0
    assert again.weights[far].sum() == pytest.approx(particles.weights[:10].sum(), rel=0.1)
    assert far.mean() > 5.0 * particles.weights[:10].sum()


def test_particles_that_all_count_are_not_drawn_anew():
    particles = particles_of(1)._replace(log_weights=np.zeros(40))
    assert particles.resampled(np.random.RandomState(0)) is particles


def test_the_likeliest_path_is_that_of_the_larger_group():
    paths = np.zeros((10, 2, 2))
    paths[:6, 1], paths[6:, 1] = [4.0, 0.0], [-9.0, 0.0]
    particles = Particles(paths, np.zeros((10, 2)), np.zeros(10))
    np.testing.assert_allclose(particles.most_likely()[-1], [4.0, 0.0])
    assert np.sqrt(particles.spread()[0, 0]) == pytest.approx(13.0 * np.sqrt(0.24))


def test_nodes_on_a_path_have_its_places_and_its_speeds_in_base_link():
    times, heading = np.arange(4) * PART, np.pi / 2.0
    motion = OdometryLog.of(Track(times, np.tile([1.0, 2.0, heading], (4, 1)))).motion(times)
    assert isinstance(motion, Motion)
    nodes = on_path(np.zeros((4, 6)), np.column_stack([0.5 * times, np.zeros(4)]), motion)
    np.testing.assert_allclose(nodes[:, :2] + [1.0, 2.0], np.column_stack([0.5 * times, np.zeros(4)]), atol=1e-9)
    np.testing.assert_allclose(nodes[:, [AHEAD, ASIDE]], np.tile([0.0, -0.5], (4, 1)), atol=1e-9)


ALONG_WALL = np.array([1.0, 0.0])
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
    return TRUE + np.where(np.arange(SCANS + 1) >= scan, length, 0.0)[:, np.newaxis] * ALONG_WALL


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
    post = heard(TRUE[:2]).selected(np.array([-1]))
    assert post.post.all()
    wall = HEARD.selected(np.flatnonzero(~HEARD.post))
    missed = MissedPosts(Echoes.joined([wall, post]), 1).cost(TRUE)
    assert 1.0 < missed < post.weights.sum()


def test_a_post_behind_a_wall_is_not_missed():
    behind = heard(TRUE[:2]).selected(np.array([-1]))._replace(arms=np.array([[0.0, 20.0]]))
    near = HEARD.selected(np.flatnonzero(~HEARD.post & (HEARD.nodes > 0)))
    assert MissedPosts(Echoes.joined([near, behind]), 1).cost(TRUE) == 0.0


@pytest.mark.long
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
