"""Follows a vehicle of whose motion only the heading is known, along many ways at once.

Each way keeps what it heard by its own places, so that several places stay open until an echo tells which is true.
"""

from dataclasses import dataclass, replace
from typing import Dict, Mapping, Optional, Tuple

import numpy as np

from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.motion.heading_factors import HeadingFactors
from mlsm_manager.joint_solver.motion.odometry_model import OdometryModel
from mlsm_manager.joint_solver.parameters import MultiViewParameters, SurfaceMatching
from mlsm_manager.joint_solver.ways.way_echoes import WayEchoes
from mlsm_manager.joint_solver.ways.way_motion import drawn, led
from mlsm_manager.joint_solver.ways.way_weighing import weighed
from mlsm_manager.joint_solver.ways.ways import Ways, begun

_COUNT = 6000  # ways: with 1000 one simulated tour of two is lost
_START_SPEED = 0.3  # m/s: the usual speed of a small vehicle
_WAYS = "ways."  # begins the names of what is stored
REMEMBERED_TURNS = 40  # about ten minutes, as long as the newest nodes of the solver stay free


@dataclass(frozen=True)
class WaySearch:
    """What is known after the scans of a log so far; the next one makes another WaySearch.

    seed: equal ones draw equal ways. remembered_turns: how far back ways reach. scans: how many were followed. echoes:
    of the newest of them. ways: None before the first scan; the first scan begins where the odometry says.
    """

    parameters: MultiViewParameters
    seed: int = 0
    remembered_turns: int = REMEMBERED_TURNS
    scans: int = 0
    echoes: Tuple[WayEchoes, ...] = ()
    ways: Optional[Ways] = None

    def followed(self, log: RunLog) -> "WaySearch":
        """Return the search after all scans of `log`, the first of which are those followed before."""
        search = self
        while search.scans < log.scan_count:
            search = search._next(log)
        return search

    @property
    def variance(self) -> float:
        """How far the ways differ [m^2] in the direction in which they differ most."""
        return 0.0 if self.ways is None else float(np.linalg.eigvalsh(self.ways.spread())[-1])

    def stored(self) -> Dict[str, np.ndarray]:
        """Return what `resumed` needs besides the log, as arrays by name."""
        ways = self.ways or Ways(np.empty((0, 1, 2)), np.empty((0, 2)), np.empty(0))
        return {_WAYS + name: value.copy() for name, value in ways._asdict().items()}

    def resumed(self, log: RunLog, stored: Mapping[str, np.ndarray]) -> "WaySearch":
        """Return the search after all scans of `log`, which `stored` it then. Raises ValueError, KeyError."""
        ways = Ways(*(stored[_WAYS + name] for name in Ways._fields))
        count, nodes = len(ways.nats), ways.paths.shape[1]
        if ways.paths.shape != (count, nodes, 2) or ways.speeds.shape != (count, 2) or nodes > log.scan_count + 1:
            raise ValueError(f"ways {ways.paths.shape}, {ways.speeds.shape} for {log.scan_count} scans")
        scans = range(log.scan_count + 1 - nodes, log.scan_count)
        echoes = tuple(WayEchoes.of(log, self.parameters.odometry, self.parameters, scan) for scan in scans)
        return replace(self, scans=log.scan_count, echoes=echoes, ways=ways if count else None)

    def _next(self, log: RunLog) -> "WaySearch":
        scan, odometry = self.scans, self.parameters.odometry
        rng = np.random.RandomState([self.seed, scan])
        motion = log.node_motion(np.array([scan, scan + 1]))
        duration, turn = float(motion.durations[0]), float(np.diff(motion.poses[:, 2])[0])
        before = self.ways or begun(_COUNT, motion.poses[0, :2], _START_SPEED, rng)
        sources = WayEchoes.of(log, odometry, self.parameters, scan)
        longest = self.remembered_turns * self.parameters.matching.scan_parts + 1
        first = scan - (before.paths.shape[1] - 1)
        targets = _targets(self.echoes, first)
        draw = drawn(before, duration, turn, rng)
        draw = draw if targets is None else led(before, draw, sources, targets, duration, rng)
        ways = before.continued(*draw, longest=longest + 1)
        if targets is not None:
            ways = weighed(ways, sources, targets, duration, self.parameters.kernel, rng).resampled(rng)
        ways = Ways(ways.paths[:, -longest:], ways.speeds, ways.nats)
        echoes = (*self.echoes, sources)[-(longest - 1) :]
        return replace(self, scans=scan + 1, echoes=echoes, ways=ways)


def _targets(echoes: Tuple[WayEchoes, ...], first: int) -> Optional[WayEchoes]:
    """Return all echoes, with nodes that count from `first`; None where there are none."""
    if not echoes:
        return None
    joined = WayEchoes.joined(echoes)
    return replace(joined, nodes=joined.nodes - first)


def needs_ways(odometry: OdometryModel, matching: SurfaceMatching) -> bool:
    """Return whether a vehicle's motion within a turn is only known from what it hears, but for its heading."""
    return type(odometry) is HeadingFactors and matching.scan_parts > 1
