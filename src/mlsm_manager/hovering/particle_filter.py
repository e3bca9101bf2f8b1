"""A particle filter for a vehicle of whose motion only the heading is known.

Each particle keeps what it heard by its own places, so that several places stay open until an echo tells which is true.
"""

from dataclasses import dataclass, replace
from typing import Dict, Mapping, Optional, Tuple

import numpy as np

from mlsm_manager.hovering.echoes import Echoes
from mlsm_manager.hovering.particle_weights import weighed
from mlsm_manager.hovering.particles import Particles, drawn, led
from mlsm_manager.joint_solver.measured.odometry_log import Motion
from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.motion.velocity_models import AHEAD, ASIDE
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.unknowns.state import YAW
from node_support.geometry import rotated

_COUNT = 6000  # particles: with 1000 one simulated tour of two is lost
_START_SPEED = 0.3  # m/s: the usual speed of a small vehicle
_REMEMBERED_TURNS = 40  # about ten minutes, as long as the newest nodes of the solver stay free
_ASTRAY = 1.0  # m, mean distance of the free nodes from the particles: farther off, they are at a wrong place
_STORED_NAMES = {"paths": "ways.paths", "speeds": "ways.speeds", "log_weights": "ways.nats"}
"""What files of maps call the fields of Particles."""


@dataclass(frozen=True)
class ParticleFilter:
    """What is known after the scans of a log so far; the next one makes another ParticleFilter. It is a NodeSearch.

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
        echoes = tuple(Echoes.of(log, parameters.odometry, parameters, scan) for scan in scans)
        return replace(self, scans=log.scan_count, echoes=echoes, particles=particles if count else None)

    def placed(self, log: RunLog, nodes: np.ndarray, parameters: SolverParameters, is_told: bool) -> np.ndarray:
        """Return the newest of `nodes` (n, width), those of the last turn or all free ones, moved onto the particles.

        All are moved where those before the last turn are far from the particles. is_told: whether the place of the
        first node was told; the particles then do not know where they lie in the map, and begin where free nodes do.
        """
        path = self.particles.most_likely()
        free = min(len(path), parameters.free_nodes, len(nodes))
        parts = min(parameters.parts_per_turn, free - 1)
        path, motion = path[-free:], log.node_motion(np.arange(len(nodes) - free, len(nodes)))
        places = motion.poses[:, :2] + nodes[-free:, :2]
        if is_told:
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
        duration, turn = float(motion.durations[0]), float(np.diff(motion.poses[:, 2])[0])
        before = self.particles or Particles.begun(_COUNT, motion.poses[0, :2], _START_SPEED, rng)
        sources = Echoes.of(log, parameters.odometry, parameters, scan)
        longest = self.remembered_turns * parameters.parts_per_turn + 1
        targets = self._targets(scan - (before.paths.shape[1] - 1))
        draw = drawn(before, duration, turn, rng)
        draw = draw if targets is None else led(before, draw, sources, targets, duration, rng)
        particles = before.continued(*draw, longest=longest + 1)
        if targets is not None:
            particles = weighed(particles, sources, targets, duration, rng).resampled(rng)
        particles = particles._replace(paths=particles.paths[:, -longest:])
        return replace(self, scans=scan + 1, echoes=(*self.echoes, sources)[-(longest - 1) :], particles=particles)

    def _targets(self, first: int) -> Optional[Echoes]:
        """Return all echoes, with nodes that count from `first`; None where there are none."""
        if not self.echoes:
            return None
        joined = Echoes.joined(self.echoes)
        return replace(joined, nodes=joined.nodes - first)


def on_path(nodes: np.ndarray, path: np.ndarray, motion: Motion) -> np.ndarray:
    """Return `nodes` (k, width), k > 1, at the places `path` (k, 2) in map, with the speeds of that path."""
    moved = nodes.copy()
    moved[:, :2] = path - motion.poses[:, :2]
    speeds = rotated(np.gradient(path, motion.times, axis=0), -(motion.poses[:, 2] + nodes[:, YAW]))
    moved[:, [AHEAD, ASIDE]] = speeds
    return moved
