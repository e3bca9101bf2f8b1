"""Weighs particles by what they heard, and moves some to where it lies better on what they heard before.

What an echo may lie on is looked for around the mean of particles that end near each other. Were all of them taken
together, echoes of the few that end far from the others would be compared with nothing, and such particles would die
out.
"""

from typing import List, NamedTuple

import numpy as np

from mlsm_manager.hovering.compiled_particles import log_likelihoods, moves_onto_echoes
from mlsm_manager.hovering.echoes import ACROSS, ALONG, AROUND, FACING, FARTHEST, Echoes
from mlsm_manager.hovering.particles import Particles, squares_of

_CELL = 6.0  # m: side of the squares within which particles end near each other, less than echoes may be apart
_GATE = 8.0  # m that two echoes may be apart on the mean path, besides twice the particles' spread
_PULLED = 0.5  # share of the particles that are moved; the others stay where the motion leads them
_FREEDOM = 0.7  # m: deviation of a particle's newest place before its echoes tell more
FADING = 0.25  # of squared deviations: half of what weights fade by, so that echoes pull from farther off


class Nearby(NamedTuple):
    """targets: that any source may lie on. sources, rows: (m,) pairs of a source and the row of such a target.

    Pairs stand in the order of their sources.
    """

    targets: Echoes
    sources: np.ndarray
    rows: np.ndarray


def weighed(
    particles: Particles, sources: Echoes, targets: Echoes, duration: float, rng: np.random.RandomState
) -> Particles:
    """Return `particles` after sources, heard in the last `duration` [s], pulled some of them and weighed all of them.

    targets: heard before; their nodes count from the particles' first one.
    """
    if not len(sources):
        return particles
    paths, speeds = particles.paths.copy(), particles.speeds.copy()
    likelihoods = np.empty(len(particles.log_weights))
    for rows in groups_of(particles.paths[:, -1]):
        group = particles.selected(rows)
        nearby = nearby_of(group, sources, targets)
        group = pulled(group, sources, nearby, duration, rng)
        paths[rows, -1], speeds[rows] = group.paths[:, -1], group.speeds
        likelihoods[rows] = likelihoods_of(group, sources, nearby)
    return Particles(paths, speeds, particles.log_weights).weighted(likelihoods)


def groups_of(ends: np.ndarray) -> List[np.ndarray]:
    """Return the rows of the ends (n, 2) [m] in each square of a grid that holds any."""
    numbers = squares_of(ends, _CELL)
    order = np.argsort(numbers, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1)


def nearby_of(particles: Particles, sources: Echoes, targets: Echoes) -> Nearby:
    """Return which targets each source may lie on: of the same kind, facing the same way, and not too far off.

    sources: heard between the particles' newest nodes. targets: before; their nodes count from the first one.
    """
    mean, last = particles.mean(), particles.paths.shape[1] - 2
    heard, earlier = sources.places(mean, int(sources.nodes[0]) - last), targets.places(mean, 0)
    gate = _GATE + 2.0 * particles.paths[:, -1].std(axis=0).max()
    reached = np.flatnonzero(((earlier > heard.min(axis=0) - gate) & (earlier < heard.max(axis=0) + gate)).all(axis=1))
    targets, apart = targets.selected(reached), np.abs(heard[:, np.newaxis] - earlier[reached])
    own, others = np.nonzero((apart[..., 0] < gate) & (apart[..., 1] < gate))
    facing = np.einsum("na,na->n", sources.normals[own], targets.normals[others]) > FACING
    near = np.hypot(apart[own, others, 0], apart[own, others, 1]) < gate
    near &= (sources.post[own] == targets.post[others]) & (sources.post[own] | facing)
    some, rows = np.unique(others[near], return_inverse=True)
    return Nearby(targets.selected(some), own[near], rows)


def likelihoods_of(particles: Particles, sources: Echoes, nearby: Nearby) -> np.ndarray:
    """Return the log likelihoods (n,) of the sources on n particles, each by what it may lie on."""
    order = np.argsort(nearby.rows, kind="stable")
    starts = np.searchsorted(nearby.rows[order], np.arange(len(nearby.targets) + 1))
    return log_likelihoods(
        np.ascontiguousarray(particles.paths), starts, nearby.sources[order], _columns(sources), sources.weights,
        nearby.targets.nodes, _columns(nearby.targets), FARTHEST,
    )  # fmt: skip


def _columns(echoes: Echoes) -> np.ndarray:
    """Return the points (n, 7) as `compiled_particles` takes them. A post has no normal of its own."""
    post = echoes.post[:, np.newaxis]
    normals = np.where(post, [1.0, 0.0], echoes.normals)
    across = normals / np.where(post, AROUND, ACROSS)
    along = np.column_stack([-normals[:, 1], normals[:, 0]]) / np.where(post, AROUND, ALONG)
    return np.ascontiguousarray(np.column_stack([echoes.arms, echoes.shares, across, along]))


def pulled(
    particles: Particles, sources: Echoes, nearby: Nearby, duration: float, rng: np.random.RandomState
) -> Particles:
    """Return the particles, some of which end where sources, heard in the last `duration` [s], lie better.

    Each of these makes one step of Gauss and Newton from where it ends: particles drawn blindly hardly ever end where
    all echoes lie on what is nearby.
    """
    some = np.flatnonzero(rng.rand(len(particles.log_weights)) < _PULLED)
    moves = pulls_of(particles.selected(some), sources, nearby)
    paths, speeds = particles.paths.copy(), particles.speeds.copy()
    paths[some, -1] += moves
    speeds[some] += moves / duration
    return Particles(paths, speeds, particles.log_weights)


def pulls_of(particles: Particles, sources: Echoes, nearby: Nearby) -> np.ndarray:
    """Return moves (n, 2) [m] of the ends of n particles, by which the sources come to lie better on what is nearby.

    Surfaces pull across themselves only.
    """
    targets, starts = nearby.targets, np.searchsorted(nearby.sources, np.arange(len(sources) + 1))
    return moves_onto_echoes(
        np.ascontiguousarray(particles.paths), starts, nearby.rows, sources.arms, sources.shares, sources.weights,
        sources.post, targets.nodes, targets.arms, targets.shares, targets.normals,
        np.array([ACROSS, ALONG, AROUND]) ** -2.0, FARTHEST, FADING, _FREEDOM**-2.0,
    )  # fmt: skip
