"""Particles of a vehicle that strafes: drawn, led to posts, pulled to echoes and weighed by them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlsm_manager.hovering.compiled_particles import ACROSS, ALONG, AROUND, FADING, FARTHEST, Echoes
from mlsm_manager.hovering.particle_filter import (
    groups_of,
    likelihoods_of,
    nearby_of,
    on_path,
    pulled,
    pulls_of,
    weighed,
)
from mlsm_manager.hovering.particles import Particles, drawn, led
from mlsm_manager.joint_solver.odometry_log import OdometryLog
from mlsm_manager.joint_solver.velocity_models import AHEAD, ASIDE
from mlsm_manager.scan_matching.scan import Track

PART = 5.0  # s


def particles_of(seed, count=40):
    rng = np.random.RandomState(seed)
    return Particles(rng.normal(0.0, 2.0, (count, 4, 2)), rng.normal(0.0, 0.3, (count, 2)), rng.normal(size=count))


def resting(count, nodes):
    """Return particles that stay at the origin."""
    return Particles(np.zeros((count, nodes, 2)), np.zeros((count, 2)), np.zeros(count))


def echoes_of(rng, node, count):
    angles = rng.uniform(0.0, 2.0 * np.pi, count)
    return Echoes(
        nodes=np.sort(rng.choice(node, count)), arms=rng.normal(0.0, 5.0, (count, 2)), shares=rng.uniform(0, 1, count),
        normals=np.column_stack([np.cos(angles), np.sin(angles)]), weights=rng.uniform(0.1, 3.0, count),
        post=rng.rand(count) < 0.3,
    )  # fmt: skip


def one_post(node, arm, share=0.5):
    """Return a post."""
    return Echoes(
        nodes=np.array([node]), arms=np.array([arm]), shares=np.array([share]), normals=np.array([[1.0, 0.0]]),
        weights=np.array([3.0]), post=np.array([True]),
    )  # fmt: skip


def nearest(particles, heard, nearby, source):
    """Return squared deviations (n,), normals (n, 2) and offsets (n, 2) [m] of the target nearest to a source."""
    rows = nearby.rows[nearby.sources == source]
    own = heard.places(particles.paths, int(heard.nodes[0]) - particles.paths.shape[1] + 2)[:, source]
    offsets, normals = nearby.targets.places(particles.paths, 0)[:, rows] - own[:, np.newaxis], nearby.targets.normals
    across = (offsets * normals[rows]).sum(axis=-1)
    beside = (offsets**2).sum(axis=-1)
    on_surface = (across / ACROSS) ** 2 + (beside - across**2) / ALONG**2
    squared = beside / AROUND**2 if heard.post[source] else on_surface
    best, every = squared.argmin(axis=1), np.arange(len(offsets))
    return squared[every, best], normals[rows][best], offsets[every, best]


def heard_and_nearby(seed, sources, targets, count):
    rng, particles = np.random.RandomState(seed), particles_of(seed, count)
    heard = echoes_of(rng, [7], sources)
    return particles, heard, nearby_of(particles, heard, echoes_of(rng, [0, 1], targets))


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
    particles = resting(1000, 3)
    particles.paths[:3, -1] = [60.0, 0.0]
    heard, earlier = one_post(1, [-30.0, 0.0], 1.0), one_post(0, [30.0, 0.0])
    log_weights = weighed(particles, heard, earlier, PART, np.random.RandomState(0)).log_weights
    np.testing.assert_allclose(log_weights[:3], 0.0)
    assert log_weights[3:].max() < -2.0


def test_particles_that_end_in_one_square_are_one_group():
    groups = groups_of(np.array([[1.0, 1.0], [50.0, 1.0], [2.0, 1.5], [51.0, 2.0], [1.0, 50.0]]))
    assert sorted(sorted(group.tolist()) for group in groups) == [[0, 2], [1, 3], [4]]


def test_a_surface_tells_nothing_to_one_that_faces_the_other_way():
    particles, wall = resting(1, 3), one_post(0, [5.0, 0.0])._replace(post=np.array([False]))
    for side, expected in ((1.0, 3.0), (-1.0, 0.0)):
        source = wall._replace(nodes=np.array([1]), normals=side * wall.normals)
        assert likelihoods_of(particles, source, nearby_of(particles, source, wall)) == pytest.approx(expected)


def test_a_part_of_a_turn_that_heard_nothing_changes_no_weight():
    nothing, particles = one_post(1, [5.0, 0.0]).selected(np.zeros(0, dtype=int)), particles_of(0)
    assert weighed(particles, nothing, one_post(0, [5.0, 0.0]), PART, np.random.RandomState(0)) is particles


def led_from_far(source, target):
    """Return those (m, 2) of 400 ends at (100, 100) that are led elsewhere, and their speeds."""
    draw, rng = (np.full((400, 2), 100.0), np.zeros((400, 2))), np.random.RandomState(0)
    ends, speeds = led(resting(400, 2), draw, source, target, PART, rng)
    moved = (ends != 100.0).any(axis=1)
    return ends[moved], speeds[moved]


def test_some_particles_are_led_to_where_posts_meet():
    ends, speeds = led_from_far(one_post(1, [3.0, 0.0], 1.0), one_post(0, [6.0, 1.0]))
    assert 50 < len(ends) < 200
    np.testing.assert_allclose(ends, np.tile([3.0, 1.0], (len(ends), 1)), atol=1.5)
    np.testing.assert_allclose(speeds, ends / PART)


def test_no_particle_is_led_faster_than_a_small_vehicle_goes():
    assert not len(led_from_far(one_post(1, [3.0, 0.0]), one_post(0, [60.0, 1.0]))[0])


def test_a_speed_is_kept_in_map_or_in_base_link_or_ends():
    particles = resting(3000, 1)
    particles.speeds[:, 0] = 0.6
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
    particles = resting(1000, 2)
    particles.paths[:10, 1] = [30.0, 0.0]
    particles.log_weights[10:] = -0.5 * np.arange(10, 1000)
    particles.log_weights[10] = np.log(990.0)
    again = particles.resampled(np.random.RandomState(0))
    far = again.paths[:, -1, 0] > 29.0
    assert again.weights[far].sum() == pytest.approx(particles.weights[:10].sum(), rel=0.1)
    assert far.mean() > 5.0 * particles.weights[:10].sum()


def test_particles_that_all_count_are_not_drawn_anew():
    particles = particles_of(1)._replace(log_weights=np.zeros(40))
    assert particles.resampled(np.random.RandomState(0)) is particles


def test_the_likeliest_path_is_that_of_the_larger_group():
    particles = resting(10, 2)
    particles.paths[:6, 1], particles.paths[6:, 1] = [4.0, 0.0], [-9.0, 0.0]
    np.testing.assert_allclose(particles.most_likely()[-1], [4.0, 0.0])
    assert np.sqrt(particles.spread()[0, 0]) == pytest.approx(13.0 * np.sqrt(0.24))


def test_nodes_on_a_path_have_its_places_and_its_speeds_in_base_link():
    times = np.arange(4) * PART
    motion = OdometryLog.of(Track(times, np.tile([1.0, 2.0, np.pi / 2.0], (4, 1)))).motion(times)
    path = np.outer(times, [0.5, 0.0])
    nodes = on_path(np.zeros((4, 6)), path, motion)
    np.testing.assert_allclose(nodes[:, :2] + [1.0, 2.0], path, atol=1e-9)
    np.testing.assert_allclose(nodes[:, [AHEAD, ASIDE]], np.tile([0.0, -0.5], (4, 1)), atol=1e-9)
