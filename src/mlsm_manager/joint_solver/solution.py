"""A run as far as it is solved: what was measured, the unknowns, and what follows from both."""

from dataclasses import dataclass, field, replace
from typing import Optional, Protocol

import numpy as np

from mlsm_manager.joint_solver.known_surfaces import KnownSurfaces
from mlsm_manager.joint_solver.motion_models import OdometryModel
from mlsm_manager.joint_solver.normal_equations import DELAY, RANGE_SCALE, State
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placement import NodePath, PlacedPoints, placed
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.submaps import Submaps
from node_support.geometry import inverse, transformed


class TimedPoints(Protocol):
    """points: (n, >= 2) m in odom. times: (n,) s, when they were heard."""

    points: np.ndarray
    times: np.ndarray


@dataclass(frozen=True)
class Solution:
    """What is passed, solved, drawn, stored and judged.

    state: the unknowns of the run in `log`. submaps: which of its scans are compared with each other. known: surfaces
    that were in the map before the run.
    """

    log: RunLog
    parameters: SolverParameters
    state: State
    submaps: Submaps = field(default_factory=lambda: Submaps(np.empty(0)))
    known: Optional[KnownSurfaces] = None

    @property
    def odometry(self) -> OdometryModel:
        """The model of the vehicle's motion."""
        return self.parameters.odometry

    def with_state(self, state: State) -> "Solution":
        """Return the run with other unknowns."""
        return replace(self, state=state)

    def placed(self, rows: np.ndarray) -> PlacedPoints:
        """Return the surface points in `rows` (n,) int of the log in the map."""
        return placed(self.log, self.odometry, self.state, self.log.points(rows), self.log.scans(rows))

    def placed_posts(self, rows: np.ndarray) -> PlacedPoints:
        """Return the echoes of posts in `rows` (n,) int of the log's table of these."""
        posts = self.log.posts
        return placed(self.log, self.odometry, self.state, posts.points(rows), posts.scans(rows))

    def node_places(self, nodes: np.ndarray) -> np.ndarray:
        """Return where `nodes` (...) of the run are, (..., 2) m in map."""
        return self.log.node_poses(nodes)[..., :2] + self.state.nodes[nodes, :2]

    def points(self, cloud: TimedPoints) -> np.ndarray:
        """Return the points (n, >= 2) of a cloud in map.

        Ranges and stamps are corrected as the run's unknowns say. Before the first node and after the last one the
        motion goes on.
        """
        seen = transformed(inverse(self.log.odometry.at(cloud.times)), cloud.points)
        sonar = self.log.sonar_in_base
        seen[:, :2] = sonar + (1.0 + self.state.run[RANGE_SCALE]) * (seen[:, :2] - sonar)
        return transformed(self.path(cloud.times + self.state.run[DELAY]), seen)

    def origins(self, cloud: TimedPoints) -> np.ndarray:
        """Return where the sonar was in map when it heard each point of a cloud, (n, 2) m."""
        path = self.path(cloud.times + self.state.run[DELAY])
        return transformed(path, np.broadcast_to(self.log.sonar_in_base, (len(path), 2)))

    def path(self, times: np.ndarray) -> np.ndarray:
        """Return T_map_base (m, 3) at `times` (m,) [s]."""
        if not len(times):
            return np.empty((0, 3))
        node_times = self.log.node_times
        first, last = np.searchsorted(node_times, [times.min(), times.max()])
        near = slice(max(min(first, len(node_times) - 1) - 1, 0), last + 1)
        return NodePath(self.odometry, self.log.odometry, node_times[near], self.state.nodes[near]).at(times)
