"""A particle filter for a vehicle of whose motion only the heading is known.

Each particle keeps what it heard by its own places, so that several places stay open until an echo tells which is true.
What an echo may lie on is looked for around the mean of particles that end near each other. Were all of them taken
together, echoes of the few that end far from the others would be compared with nothing, and such particles would die
out.
"""

from dataclasses import dataclass, replace
from typing import Dict, List, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from mlsm_manager.hovering.compiled_particles import ACROSS, ALONG, AROUND, Echoes, log_likelihoods, moves_onto_echoes
from mlsm_manager.hovering.particles import FACING, Particles, drawn, echoes_of, led
from mlsm_manager.joint_solver.normal_equations import YAW
from mlsm_manager.joint_solver.odometry_log import Motion
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.velocity_models import AHEAD, ASIDE
from node_support.geometry import rotated, squares_of

_COUNT = 6000  # particles: with 1000 one simulated tour of two is lost
_START_SPEED = 0.3  # m/s: the usual speed of a small vehicle
_REMEMBERED_TURNS = 40  # about ten minutes, as long as the newest nodes of the solver stay free
_ASTRAY = 1.0  # m, mean distance of the free nodes from the particles: farther off, they are at a wrong place
_STORED_NAMES = {"paths": "ways.paths", "speeds": "ways.speeds", "log_weights": "ways.nats"}  # in files of maps
_CELL = 6.0  # m: side of the squares within which particles end near each other, less than echoes may be apart
_GATE = 8.0  # m that two echoes may be apart on the mean path, besides twice the particles' spread
_PULLED = 0.5  # share of the particles that are moved; the others stay where the motion leads them


@dataclass(frozen=True)
class ParticleFilter:
    """What is known after the scans of a log so far; the next one makes another ParticleFilter.

    seed: equal ones draw equal particles. remembered_turns: how far back paths reach. scans: how many were followed.
    echoes: of the newest of them. particles: None before the first scan, which begins where the odometry says.
    """

    seed: int = 0
    remembered_turns: int = _REMEMBERED_TURNS
    scans: int = 0
    echoes: Tuple[Echoes, ...] = ()
    particles: Optional[Particles] = None

    def followed(self, log: RunLog, parameters: SolverParameters) -> "ParticleFilter":
        """Return the filter after all scans of `log`, the first of which are those followed before."""
        known = self
        while known.scans < log.scan_count:
            known = known._next(log, parameters)
        return known

    @property
    def variance(self) -> float:
        """How far the particles differ [m^2] in the direction in which they differ most."""
        return 0.0 if self.particles is None else float(np.linalg.eigvalsh(self.particles.spread())[-1])

    def stored(self) -> Dict[str, np.ndarray]:
        """Return what `resumed` needs besides the log, as arrays by name."""
        particles = self.particles or Particles(np.empty((0, 1, 2)), np.empty((0, 2)), np.empty(0))
        return {name: getattr(particles, field).copy() for field, name in _STORED_NAMES.items()}

    def resumed(self, log: RunLog, parameters: SolverParameters, stored: Mapping[str, np.ndarray]) -> "ParticleFilter":
        """Return the filter after all scans of `log`, which `stored` it then. Raises ValueError, KeyError."""
        particles = Particles(**{field: stored[name] for field, name in _STORED_NAMES.items()})
        count, nodes = len(particles.log_weights), particles.paths.shape[1]
        shapes = particles.paths.shape, particles.speeds.shape
        if shapes != ((count, nodes, 2), (count, 2)) or nodes > log.scan_count + 1:
            raise ValueError(f"particles {shapes[0]}, {shapes[1]} for {log.scan_count} scans")
        scans = range(log.scan_count + 1 - nodes, log.scan_count)
        echoes = tuple(echoes_of(log, parameters, scan) for scan in scans)
        return replace(self, scans=log.scan_count, echoes=echoes, particles=particles if count else None)

    def placed(self, log: RunLog, nodes: np.ndarray, parameters: SolverParameters, starts_known: bool) -> np.ndarray:
        """Return the newest of `nodes` (n, width), those of the last turn or all free ones, moved onto the particles.

        All are moved where those before the last turn are far from the particles. starts_known: whether the place of
        the first node was known; particles then do not know where they lie in the map, and begin where free nodes do.
        """
        path = self.particles.most_likely()
        free = min(len(path), parameters.free_nodes, len(nodes))
        parts = min(parameters.parts_per_turn, free - 1)
        path, motion = path[-free:], log.node_motion(np.arange(len(nodes) - free, len(nodes)))
        places = motion.poses[:, :2] + nodes[-free:, :2]
        if starts_known:
            path = path + places[0] - path[0]
        apart = np.hypot(*(places - path)[:-parts].T)
        if apart.mean() > _ASTRAY:
            return on_path(nodes[-free:], path, motion)
        path = path + (places - path)[-parts - 1]
        return on_path(nodes[-free:], path, motion)[-parts:]

    def _next(self, log: RunLog, parameters: SolverParameters) -> "ParticleFilter":
        scan = self.scans
        rng = np.random.RandomState([self.seed, scan])
        motion = log.node_motion(np.array([scan, scan + 1]))
        duration, turn = (float(np.diff(each)[0]) for each in (motion.times, motion.poses[:, 2]))
        before = self.particles or Particles.begun(_COUNT, motion.poses[0, :2], _START_SPEED, rng)
        sources = echoes_of(log, parameters, scan)
        longest = self.remembered_turns * parameters.parts_per_turn + 1
        targets = Echoes.joined(self.echoes) if self.echoes else None
        if targets is not None:
            targets = targets._replace(nodes=targets.nodes - (scan - (before.paths.shape[1] - 1)))
        draw = drawn(before, duration, turn, rng)
        draw = draw if targets is None else led(before, draw, sources, targets, duration, rng)
        particles = before.continued(*draw, longest=longest + 1)
        if targets is not None:
            particles = weighed(particles, sources, targets, duration, rng).resampled(rng)
        particles = particles._replace(paths=particles.paths[:, -longest:])
        return replace(self, scans=scan + 1, echoes=(*self.echoes, sources)[-(longest - 1) :], particles=particles)


def on_path(nodes: np.ndarray, path: np.ndarray, motion: Motion) -> np.ndarray:
    """Return `nodes` (k, width), k > 1, at the places `path` (k, 2) in map, with the speeds of that path."""
    moved = nodes.copy()
    moved[:, :2] = path - motion.poses[:, :2]
    speeds = rotated(np.gradient(path, motion.times, axis=0), -(motion.poses[:, 2] + nodes[:, YAW]))
    moved[:, [AHEAD, ASIDE]] = speeds
    return moved


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
    if not sources.size:
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
    starts = np.searchsorted(nearby.rows[order], np.arange(nearby.targets.size + 1))
    paths, targets = np.ascontiguousarray(particles.paths), nearby.targets
    return log_likelihoods(paths, starts, nearby.sources[order], _columns(sources), targets.nodes, _columns(targets))


def _columns(echoes: Echoes) -> np.ndarray:
    """Return the points (n, 8) as `compiled_particles` takes them. A post has no normal of its own."""
    post = echoes.post[:, np.newaxis]
    normals = np.where(post, [1.0, 0.0], echoes.normals)
    across = normals / np.where(post, AROUND, ACROSS)
    along = np.column_stack([-normals[:, 1], normals[:, 0]]) / np.where(post, AROUND, ALONG)
    return np.ascontiguousarray(np.column_stack([echoes.arms, echoes.shares, echoes.weights, across, along]))


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
    starts = np.searchsorted(nearby.sources, np.arange(sources.size + 1))
    return moves_onto_echoes(np.ascontiguousarray(particles.paths), starts, nearby.rows, sources, nearby.targets)
