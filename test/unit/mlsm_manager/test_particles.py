"""Particles of a vehicle that strafes: drawn, led to posts, weighed and drawn anew."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mlsm_manager.hovering.echoes import ACROSS, ALONG, AROUND, FARTHEST, Echoes
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
from mlsm_manager.hovering.particles import Particles, drawn, led
from mlsm_manager.joint_solver.odometry_log import Motion, OdometryLog
from mlsm_manager.joint_solver.velocity_models import AHEAD, ASIDE
from mlsm_manager.scan_matching.scan import Track

PART = 5.0  # s


def particles_of(seed, count=40, nodes=4):
    rng = np.random.RandomState(seed)
    return Particles(rng.normal(0.0, 2.0, (count, nodes, 2)), rng.normal(0.0, 0.3, (count, 2)), rng.normal(size=count))


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


def post(node, arm, share=0.5):
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
@settings(max_examples=30, deadline=None)
def test_each_source_counts_by_its_nearest_target(seed, sources, targets):
    particles, heard, nearby = heard_and_nearby(seed, sources, targets, count=100)
    expected = np.zeros(100)
    for source in np.unique(nearby.sources):
        squared = nearest(particles, heard, nearby, source)[0]
        expected += heard.weights[source] * np.where(squared < FARTHEST, np.exp(-0.5 * squared), 0.0)
    np.testing.assert_allclose(likelihoods_of(particles, heard, nearby), expected, rtol=1e-9, atol=1e-9)


@given(st.integers(0, 10**6), st.integers(1, 30), st.integers(1, 60))
@settings(max_examples=30, deadline=None)
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
    heard = post(1, [5.0, 0.0], 1.0)
    nearby, rng = nearby_of(particles, heard, post(0, [6.0, 0.0])), np.random.RandomState(0)
    moved = pulled(particles, heard, nearby, PART, rng)
    assert 100 < (moved.paths[:, -1, 0] > 0.0).sum() < 300
    np.testing.assert_allclose(moved.speeds, moved.paths[:, -1] / PART)


def test_few_particles_far_from_all_others_are_compared_with_what_they_heard_there():
    paths = np.zeros((1000, 3, 2))
    paths[:3, -1] = [60.0, 0.0]
    particles = Particles(paths, np.zeros((1000, 2)), np.zeros(1000))
    heard, earlier = post(1, [-30.0, 0.0], 1.0), post(0, [30.0, 0.0])
    log_weights = weighed(particles, heard, earlier, PART, np.random.RandomState(0)).log_weights
    np.testing.assert_allclose(log_weights[:3], 0.0)
    assert log_weights[3:].max() < -2.0


def test_particles_that_end_in_one_square_are_one_group():
    groups = groups_of(np.array([[1.0, 1.0], [50.0, 1.0], [2.0, 1.5], [51.0, 2.0], [1.0, 50.0]]))
    assert sorted(sorted(group.tolist()) for group in groups) == [[0, 2], [1, 3], [4]]


def test_a_surface_tells_nothing_to_one_that_faces_the_other_way():
    particles = resting(1, 3)
    wall = replace(post(0, [5.0, 0.0]), post=np.array([False]))
    behind = replace(wall, nodes=np.array([1]), normals=-wall.normals)
    assert likelihoods(particles, behind, wall) == 0.0
    assert likelihoods(particles, replace(wall, nodes=np.array([1])), wall) == pytest.approx(3.0)


def test_a_part_of_a_turn_that_heard_nothing_changes_no_weight():
    nothing, particles = post(1, [5.0, 0.0]).selected(np.zeros(0, dtype=int)), particles_of(0)
    assert weighed(particles, nothing, post(0, [5.0, 0.0]), PART, np.random.RandomState(0)) is particles


def test_some_particles_are_led_to_where_posts_meet():
    rng, particles, far = np.random.RandomState(0), resting(400, 2), np.full((400, 2), 100.0)
    ends, speeds = led(particles, (far, np.zeros((400, 2))), post(1, [3.0, 0.0], 1.0), post(0, [6.0, 1.0]), PART, rng)
    moved = ends[:, 0] < 50.0
    assert 50 < moved.sum() < 200
    np.testing.assert_allclose(ends[moved], np.tile([3.0, 1.0], (moved.sum(), 1)), atol=1.5)
    np.testing.assert_allclose(speeds[moved], ends[moved] / PART)


def test_no_particle_is_led_faster_than_a_small_vehicle_goes():
    draw, rng = (np.zeros((400, 2)), np.zeros((400, 2))), np.random.RandomState(0)
    ends, _ = led(resting(400, 2), draw, post(1, [3.0, 0.0]), post(0, [60.0, 1.0]), PART, rng)
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
