"""Particles of a vehicle that keeps its speed for a while, stops, starts anew and strafes.

Gordon, Salmond and Smith 1993; each particle has a path, and so a map, of its own as in FastSLAM (Montemerlo et al.
2002).
"""

from typing import NamedTuple, Tuple

import numpy as np

from mlsm_manager.hovering.compiled_particles import Echoes
from mlsm_manager.joint_solver.normal_equations import State
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.solution import Solution
from node_support.geometry import squares_of

FACING = 0.75  # least cosine between two normals, so that both sides of a wall stay apart

_SURFACE_WEIGHT = 0.4  # of a point on a surface: neighbours share errors
# Of a post where an earlier one stood. Of those heard on simulated tours of a basin 85 % lie within 1.5 m of an
# earlier one where the path is true and 1 % where it is not; in a harbour 60 % and 5 %.
_POST_WEIGHT = 3.0
_POST_POWER = 0.5  # of their qualities: weak ones are heard again nearly as often as strong ones


def echoes_of(log: RunLog, parameters: SolverParameters, scan: int) -> Echoes:
    motion = log.node_motion(np.array([scan, scan + 1]))
    nodes = np.zeros((log.scan_count + 1, parameters.odometry.width))
    nodes[scan : scan + 2, :2] = -motion.poses[:, :2]
    solution = Solution(log, parameters, State(nodes, parameters.run_mean(log)))
    surfaces = solution.placed(log.surfaces.heard(scan, scan + 1))
    posts = solution.placed(log.posts.heard(scan, scan + 1))
    weights = parameters.post_confidence * _POST_WEIGHT * posts.qualities**_POST_POWER
    return Echoes.joined([_made(surfaces, _SURFACE_WEIGHT * surfaces.qualities), _made(posts, weights, True)])


def echoes_of_run(log: RunLog, parameters: SolverParameters) -> Echoes:
    return Echoes.joined([echoes_of(log, parameters, scan) for scan in range(log.scan_count)])


def _made(points: PlacedPoints, weights: np.ndarray, is_post: bool = False) -> Echoes:
    post = np.full(len(points), is_post)
    return Echoes(points.scans, points.places, points.shares, points.normals, weights, post)


Draw = Tuple[np.ndarray, np.ndarray]
"""Places (n, 2) [m] at the next node and speeds (n, 2) [m/s] there."""

_HELD_SPEED = 0.02  # m/s: of a vehicle that holds its place
_ALIKE = 1.0  # m by which the ends of particles may differ that count as one
_CENTRES = 100  # particles around whose ends the others are counted: enough that one is near the middle of each group
_PLACE = 2.0  # m: side of the squares that count as one place
_ROOT = 0.5  # power of its weight by which a place is drawn: with a hundredth of the weight it has a tenth of them
_NOTHING = 1e-300  # least weight of a place, so that none is divided by zero
_UNEVEN = 0.5  # share of the particles that must still count, or else they are drawn anew

_CHANGE = 0.2  # chance that the speed jumps within a part of a turn: on average once in 27 s
_STOP = 0.4  # of these changes end at rest
_NEW_SPEED = 0.4  # m/s: deviation of a speed in each direction after a change
_WALK = 0.07  # m/s: by which a speed that is kept strays within a part
_ACCELERATE = 0.3  # share of the speeds that do not jump but change gradually,
_ACCELERATION = 0.35  # m/s: by so much within a part, as of a vehicle that takes ten seconds to start and to stop
_ROUGH = 0.05  # m: by which steps stray besides
_GUIDED = 0.25  # share of the particles that are led to where a post is heard again
_FASTEST = 1.3  # m/s: of particles that are led
_LEAST_SHARE = 0.15  # of a part: an echo heard sooner tells too little of the speed


class Particles(NamedTuple):
    """paths: (n, k, 2) m, places in map at the newest k nodes. speeds: (n, 2) m/s in map. log_weights: (n,)."""

    paths: np.ndarray
    speeds: np.ndarray
    log_weights: np.ndarray

    @classmethod
    def begun(cls, count: int, place: np.ndarray, speed: float, rng: np.random.RandomState) -> "Particles":
        """Return `count` particles that begin at `place` (2,): half of them at rest, half at about `speed` [m/s]."""
        deviations = np.where(rng.rand(count, 1) < 0.5, _HELD_SPEED, speed)
        return cls(np.tile(place, (count, 1, 1)), deviations * rng.normal(size=(count, 2)), np.zeros(count))

    @property
    def weights(self) -> np.ndarray:
        """(n,), which sum to 1."""
        weights = np.exp(self.log_weights - self.log_weights.max())
        return weights / weights.sum()

    def mean(self) -> np.ndarray:
        """Return the mean path (k, 2)."""
        return np.einsum("n,nka->ka", self.weights, self.paths)

    def most_likely(self) -> np.ndarray:
        """Return the mean path (k, 2) of the particles that end about where most weight is."""
        ends, weights = self.paths[:, -1], self.weights
        some = np.argsort(-weights, kind="stable")[:: max(1, len(ends) // _CENTRES)]
        alike = ((ends[some, np.newaxis] - ends) ** 2).sum(axis=2) < _ALIKE**2
        best = alike[np.argmax(alike @ weights)]
        return np.einsum("n,nka->ka", weights[best], self.paths[best]) / weights[best].sum()

    def spread(self) -> np.ndarray:
        """Return the covariance (2, 2) [m^2] of the ends."""
        ends, weights = self.paths[:, -1], self.weights
        offset = ends - weights @ ends
        return (offset * weights[:, np.newaxis]).T @ offset

    def selected(self, rows: np.ndarray) -> "Particles":
        """Return the particles in `rows` (m,)."""
        return Particles(self.paths[rows], self.speeds[rows], self.log_weights[rows])

    def continued(self, ends: np.ndarray, speeds: np.ndarray, longest: int) -> "Particles":
        """Return them with places (n, 2) at the next node and `speeds` (n, 2) there; no longer than `longest`."""
        paths = np.concatenate([self.paths[:, -longest + 1 :], ends[:, np.newaxis]], axis=1)
        return Particles(paths, speeds, self.log_weights)

    def weighted(self, log_likelihoods: np.ndarray) -> "Particles":
        """Return the particles after something was heard of which each has a log likelihood (n,)."""
        total = self.log_weights + log_likelihoods
        return self._replace(log_weights=total - total.max())

    def resampled(self, rng: np.random.RandomState) -> "Particles":
        """Return as many particles, drawn anew where few of them count; or else the same.

        A place keeps particles in proportion to the square root of its weight; the other half of its log weight stays
        with them. Drawn in proportion to the weight, a place where nothing is heard for a minute would lose all.
        """
        weights, count, squares = self.weights, len(self.log_weights), squares_of(self.paths[:, -1], _PLACE)
        held = np.maximum(np.bincount(squares, weights=weights)[squares], _NOTHING)
        chances = weights * held ** (_ROOT - 1.0)
        chances /= chances.sum()
        if 1.0 / (chances**2).sum() >= _UNEVEN * count:
            return self
        chosen = np.searchsorted(np.cumsum(chances), (rng.rand() + np.arange(count)) / count)
        chosen = np.minimum(chosen, count - 1)
        log_weights = (1.0 - _ROOT) * np.log(held[chosen])
        return Particles(self.paths.take(chosen, axis=0), self.speeds[chosen], log_weights - log_weights.max())


def drawn(particles: Particles, duration: float, turn: float, rng: np.random.RandomState) -> Draw:
    """Return where particles may be `duration` [s] later, when the heading has changed by `turn` [rad].

    A speed that is kept is kept in map by half of them, and in base_link by the others.
    """
    count = len(particles.log_weights)
    with_heading = rng.rand(count, 1) < 0.5
    strays = np.where(rng.rand(count, 1) < _ACCELERATE, _ACCELERATION, _WALK)
    kept = np.where(with_heading, _turned(particles.speeds, turn), particles.speeds)
    kept = kept + strays * rng.normal(size=(count, 2))
    new = np.where(rng.rand(count, 1) < _STOP, _HELD_SPEED, _NEW_SPEED) * rng.normal(size=(count, 2))
    changes, before = rng.rand(count, 1) < _CHANGE, duration * rng.rand(count, 1)
    speeds = np.where(changes, new, kept)
    jumped, smooth = before * particles.speeds + (duration - before) * new, duration / 2.0 * (particles.speeds + kept)
    steps = np.where(changes, jumped, smooth)
    return particles.paths[:, -1] + steps + _ROUGH * rng.normal(size=(count, 2)), speeds


def led(
    particles: Particles, draw: Draw, sources: Echoes, targets: Echoes, duration: float, rng: np.random.RandomState
) -> Draw:
    """Return `draw`, but for some particles that end where a post among `sources` is one of `targets`.

    Particles drawn blindly hardly ever meet all posts, which tell the most where walls tell nothing.
    targets: their nodes count from the particles' first one. duration: s.
    """
    own, earlier = sources.selected(sources.post), targets.selected(targets.post)
    if not own.size or not earlier.size:
        return draw
    some = np.flatnonzero(rng.rand(len(particles.log_weights)) < _GUIDED)
    chosen = rng.randint(own.size, size=len(some))
    at_rest = particles.paths[some, -1] + own.arms[chosen]
    shares = np.maximum(own.shares[chosen], _LEAST_SHARE)
    speeds = (earlier.places(particles.paths[some], 0) - at_rest[:, np.newaxis]) / (duration * shares)[:, None, None]
    possible = np.hypot(speeds[..., 0], speeds[..., 1]) < _FASTEST
    target = (rng.rand(*possible.shape) * possible).argmax(axis=1)
    led_ones = possible.any(axis=1)
    some, speeds = some[led_ones], speeds[np.arange(len(some)), target][led_ones]
    speeds = speeds + _ROUGH * rng.normal(size=speeds.shape)
    ends, new = draw
    ends[some], new[some] = particles.paths[some, -1] + duration * speeds, speeds
    return ends, new


def _turned(speeds: np.ndarray, turn: float) -> np.ndarray:
    cosine, sine = np.cos(turn), np.sin(turn)
    return speeds @ np.array([[cosine, sine], [-sine, cosine]])
