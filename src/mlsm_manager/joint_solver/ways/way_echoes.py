"""What parts of turns heard, as ways of a vehicle are compared with it: the heading is known, the places are not."""

from dataclasses import dataclass, fields
from typing import Sequence

import numpy as np

from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.motion.odometry_model import OdometryModel
from mlsm_manager.joint_solver.parameters import MultiViewParameters
from mlsm_manager.joint_solver.placing.placement import PlacedPoints, place, place_lone
from mlsm_manager.joint_solver.priors import run_mean
from mlsm_manager.joint_solver.unknowns.state import State

_SURFACE_NATS = 0.4  # that a point on a surface is worth: neighbours share errors
_LONE_NATS = 3.0
"""That an echo which stands alone is worth where an earlier one stood. Of those heard on simulated tours of a basin
85 % lie within 1.5 m of an earlier one where the path is true and 1 % where it is not; in a harbour 60 % and 5 %."""
_LONE_POWER = 0.5  # of their qualities: weak ones are heard again nearly as often as strong ones


@dataclass(frozen=True)
class WayEchoes:
    """n points. nodes: (n,) those before them. arms: (n, 2) m, from the straight line between nodes to them, in map.

    shares: (n,) when they were heard, 0 at the node before, 1 at the next. normals: (n, 2) in map. nats: (n,) that they
    are worth. lone: (n,) bool, whether they stand alone.
    """

    nodes: np.ndarray
    arms: np.ndarray
    shares: np.ndarray
    normals: np.ndarray
    nats: np.ndarray
    lone: np.ndarray

    def __len__(self) -> int:
        return len(self.nodes)

    @classmethod
    def of(cls, log: RunLog, odometry: OdometryModel, parameters: MultiViewParameters, scan: int) -> "WayEchoes":
        """Return those of a scan of the log."""
        motion = log.node_motion(np.array([scan, scan + 1]))
        nodes = np.zeros((log.scan_count + 1, odometry.width))
        nodes[scan : scan + 2, :2] = -motion.poses[:, :2]
        state = State(nodes, run_mean(parameters.sonar))
        surfaces = place(log, odometry, state, log.rows(scan, scan + 1))
        lone = place_lone(log, odometry, state, log.lone.rows(scan, scan + 1))
        worth = parameters.matching.lone_quality * _LONE_NATS * lone.qualities**_LONE_POWER
        return cls.joined([cls._made(surfaces, _SURFACE_NATS * surfaces.qualities), cls._made(lone, worth, True)])

    @classmethod
    def of_run(cls, log: RunLog, odometry: OdometryModel, parameters: MultiViewParameters) -> "WayEchoes":
        """Return those of all scans of the log, at least one."""
        return cls.joined([cls.of(log, odometry, parameters, scan) for scan in range(log.scan_count)])

    @classmethod
    def _made(cls, points: PlacedPoints, nats: np.ndarray, lone: bool = False) -> "WayEchoes":
        return cls(points.scans, points.places, points.shares, points.normals, nats, np.full(len(points), lone))

    @classmethod
    def joined(cls, parts: Sequence["WayEchoes"]) -> "WayEchoes":
        """Return the points of all `parts`, at least one."""
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))

    def selected(self, rows: np.ndarray) -> "WayEchoes":
        """Return the points in `rows` (m,)."""
        return WayEchoes(*(getattr(self, field.name)[rows] for field in fields(self)))

    def places(self, paths: np.ndarray, first: int) -> np.ndarray:
        """Return where the points lie (..., n, 2) for paths (..., k, 2), whose first node is `first`."""
        before, share = self.nodes - first, self.shares[:, np.newaxis]
        return self.arms + (1.0 - share) * paths[..., before, :] + share * paths[..., before + 1, :]
