"""Where the points of scans lie in the map, given the unknowns, and how these move them."""

from dataclasses import dataclass, fields, replace
from typing import Union

import numpy as np

from mlsm_manager.joint_solver.compiled.compiled_places import placed_rows
from mlsm_manager.joint_solver.measured.odometry_log import Motion
from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.measured.surface_points import SurfacePoints
from mlsm_manager.joint_solver.motion.motion_models import OdometryModel
from mlsm_manager.joint_solver.placing.path import NodePath
from mlsm_manager.joint_solver.unknowns.state import DELAY, RANGE_SCALE, YAW, State

_HALF_SECOND = 0.5  # the velocity of a point is averaged over one second, longer than the odometry's period


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


def placed(
    log: RunLog, odometry: OdometryModel, state: State, points: SurfacePoints, scans: np.ndarray
) -> PlacedPoints:
    """Return points that `scans` (n,) heard in the map. NodePath says where the vehicle was between two nodes."""
    if not len(points):
        return _NO_POINTS
    times = points.times + state.run[DELAY]
    nodes = np.unique(np.concatenate([scans, scans + 1]))
    path = NodePath(odometry, log.odometry, log.node_times[nodes], state.nodes[nodes])
    known = log.odometry.between(times.min() - _HALF_SECOND, times.max() + _HALF_SECOND)
    rows = placed_rows(
        times, np.searchsorted(nodes, scans), points.ranges, points.bearings, points.normals, log.sonar_in_base,
        float(state.run[RANGE_SCALE]), path.table, _knots(odometry, known), _HALF_SECOND,
    )  # fmt: skip
    return PlacedPoints(
        scans=scans, places=rows[:, 0:2], arms=rows[:, 2:4], normals=rows[:, 4:6], slants=points.slants,
        qualities=points.qualities, shares=rows[:, 10], by_run=rows[:, 6:10].reshape(-1, 2, 2),
    )  # fmt: skip


def _knots(odometry: OdometryModel, known: Motion) -> np.ndarray:
    """Return poses of the odometry (k, 4) as `compiled_places` takes them: a reference path is even between them."""
    reference = odometry.reference(known)
    return np.column_stack([known.times, known.poses[:, YAW], reference.real, reference.imag])


def place(log: RunLog, odometry: OdometryModel, state: State, rows: np.ndarray) -> PlacedPoints:
    """Return the surface points in `rows` (n,) int of the log."""
    return placed(log, odometry, state, log.points(rows), log.scans(rows))


def place_lone(log: RunLog, odometry: OdometryModel, state: State, rows: np.ndarray) -> PlacedPoints:
    """Return the lone points in `rows` (n,) int of the log's table of these."""
    return placed(log, odometry, state, log.lone.points(rows), log.lone.scans(rows))


_NO_POINTS = PlacedPoints(
    scans=np.empty(0, dtype=np.int64), places=np.empty((0, 2)), arms=np.empty((0, 2)), normals=np.empty((0, 2)),
    slants=np.empty(0), qualities=np.empty(0), shares=np.empty(0), by_run=np.empty((0, 2, 2)),
)  # fmt: skip
