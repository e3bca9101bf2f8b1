"""Where the points of scans lie in the map, given the unknowns, and how these move them."""

from dataclasses import dataclass, fields, replace
from typing import Callable, Union

import numpy as np

from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.measured.surface_points import SurfacePoints
from mlsm_manager.joint_solver.motion.odometry_model import OdometryModel
from mlsm_manager.joint_solver.placing.path import NodePath
from mlsm_manager.joint_solver.unknowns.state import DELAY, RANGE_SCALE, YAW, State
from node_support.geometry import rotated

HALF_SECOND = 0.5
"""s: the velocity of a point is averaged over one second, longer than the odometry's period."""


@dataclass(frozen=True)
class PlacedPoints:
    """n points in the map.

    scans: (n,) which scan heard them. places: (n, 2) m. arms: (n, 2) m, by which the nodes' yaw turns them: from
    base_link to them, and the bow of the path between the nodes. normals: (n, 2). slants: (n,) m. qualities: (n,).
    shares: (n,) when they were heard: 0 at the scan's first node, 1 at its second. by_run: (n, 2, 2) derivatives of the
    places by range scale and delay, last axis the unknown.
    """

    scans: np.ndarray
    places: np.ndarray
    arms: np.ndarray
    normals: np.ndarray
    slants: np.ndarray
    qualities: np.ndarray
    shares: np.ndarray
    by_run: np.ndarray

    def __len__(self) -> int:
        return len(self.scans)

    def moved_by_run(self, change: np.ndarray) -> "PlacedPoints":
        """Return the points after the run's unknowns changed a little, by `change` (2,), to first order."""
        places = self.places + self.by_run @ change
        return replace(self, places=places)

    def selected(self, rows: Union[np.ndarray, slice]) -> "PlacedPoints":
        """Return the points in `rows`: indices, (n,) bool, or a slice, which copies nothing."""
        return PlacedPoints(*(getattr(self, field.name)[rows] for field in fields(self)))

    def joined_with(self, others: "PlacedPoints") -> "PlacedPoints":
        """Return these points and then the others."""
        names = [field.name for field in fields(self)]
        return PlacedPoints(*(np.concatenate([getattr(self, name), getattr(others, name)]) for name in names))


Placing = Callable[[RunLog, OdometryModel, State, SurfacePoints, np.ndarray], PlacedPoints]
"""Takes the log, the odometry, the state, points and the scans (n,) that heard them."""


def placed(
    log: RunLog, odometry: OdometryModel, state: State, points: SurfacePoints, scans: np.ndarray
) -> PlacedPoints:
    """Return points in the map; see Placing. NodePath says where the vehicle was between two nodes."""
    times = points.times + state.run[DELAY]
    nodes = np.unique(np.concatenate([scans, scans + 1]))
    legs = np.searchsorted(nodes, scans)
    path = NodePath(odometry, log.odometry, log.node_times[nodes], state.nodes[nodes])
    poses, bows = path.poses_and_bows(times, legs)
    sight = _unit(points.bearings + poses[:, YAW]) * points.ranges[:, np.newaxis]
    mounting = rotated(np.broadcast_to(log.sonar_in_base, sight.shape), poses[:, YAW])
    arms = mounting + (1.0 + state.run[RANGE_SCALE]) * sight
    velocity = path.velocities(times, legs, HALF_SECOND)
    by_delay = velocity[:, :2] + velocity[:, 2:] * np.column_stack([-arms[:, 1], arms[:, 0]])
    return PlacedPoints(
        scans=scans, places=poses[:, :2] + arms, arms=arms + bows,
        normals=rotated(points.normals, poses[:, YAW]),
        slants=points.slants, qualities=points.qualities, shares=path.shares(times, legs),
        by_run=np.stack([sight, by_delay], axis=2),
    )  # fmt: skip


def place(
    log: RunLog, odometry: OdometryModel, state: State, rows: np.ndarray, placing: Placing = placed
) -> PlacedPoints:
    """Return the surface points in `rows` (n,) int of the log."""
    return placing(log, odometry, state, log.points(rows), log.scans(rows))


def place_lone(log: RunLog, odometry: OdometryModel, state: State, rows: np.ndarray) -> PlacedPoints:
    """Return the lone points in `rows` (n,) int of the log's table of these."""
    return placed(log, odometry, state, log.lone.points(rows), log.lone.scans(rows))


def _unit(angles: np.ndarray) -> np.ndarray:
    return np.column_stack([np.cos(angles), np.sin(angles)])
