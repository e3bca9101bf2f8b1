"""Where the vehicle was at any time, and where the points of scans lie in the map, given the unknowns."""

from dataclasses import dataclass, fields, replace
from typing import Union

import numpy as np

from mlsm_manager.joint_solver.compiled_placement import Heard, path_rows, placed_rows
from mlsm_manager.joint_solver.motion_models import OdometryModel
from mlsm_manager.joint_solver.normal_equations import DELAY, RANGE_SCALE, YAW, State
from mlsm_manager.joint_solver.odometry_log import Motion, OdometryLog
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.surface_points import SurfacePoints

_HALF_SECOND = 0.5  # the velocity of a point is averaged over one second, longer than the odometry's period


def solved_path(
    log: OdometryLog, odometry: OdometryModel, node_times: np.ndarray, nodes: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """Return T_map_base (m, 3) at any `times` (m,) [s]; before the first node and after the last as it goes on.

    node_times: (n,) s, n > 1. nodes: (n, width).
    """
    if not len(times):
        return np.empty((0, 3))
    first, last = np.searchsorted(node_times, [times.min(), times.max()])
    near = slice(max(min(first, len(node_times) - 1) - 1, 0), last + 1)
    node_times, nodes = node_times[near], nodes[near]
    known = log.between(min(times.min(), node_times[-1]), max(times.max(), node_times[0]))
    return path_rows(times, _legs(log, odometry, node_times, nodes), _knots(odometry, known))


def _legs(log: OdometryLog, odometry: OdometryModel, times: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Return the nodes (n, 8) as compiled loops take them; times: (n,) s. nodes: (n, width).

    Between two of them the path is the model's reference path, turned and scaled by the mean of their gains, and
    stretched to lead from one to the other. The last gain is that with which it goes on.
    """
    motion = log.motion(times)
    places, reference, gain = motion.poses[:, :2] + nodes[:, :2], odometry.reference(motion), odometry.gain(nodes)
    gain[:-1] = (gain[:-1] + gain[1:]) / 2.0
    return np.column_stack([times, places, nodes[:, YAW], reference.real, reference.imag, gain.real, gain.imag])


def _knots(odometry: OdometryModel, known: Motion) -> np.ndarray:
    """Return poses of the odometry (k, 4) as compiled loops take them: a reference path is even between them."""
    reference = odometry.reference(known)
    return np.column_stack([known.times, known.poses[:, YAW], reference.real, reference.imag])


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
    """Return points that `scans` (n,) heard in the map, from the path between the two nodes of each."""
    if not len(points):
        return _NO_POINTS
    times = points.times + state.run[DELAY]
    nodes = np.unique(np.concatenate([scans, scans + 1]))
    known = log.odometry.between(times.min() - _HALF_SECOND, times.max() + _HALF_SECOND)
    heard = Heard(times, np.searchsorted(nodes, scans), points.ranges, points.bearings, points.normals)
    path = _legs(log.odometry, odometry, log.node_times[nodes], state.nodes[nodes]), _knots(odometry, known)
    rows = placed_rows(heard, log.sonar_in_base, float(state.run[RANGE_SCALE]), *path, _HALF_SECOND)
    return PlacedPoints(
        scans=scans, places=rows[:, 0:2], arms=rows[:, 2:4], normals=rows[:, 4:6], slants=points.slants,
        qualities=points.qualities, shares=rows[:, 10], by_run=rows[:, 6:10].reshape(-1, 2, 2),
    )  # fmt: skip


_NO_POINTS = PlacedPoints(
    scans=np.empty(0, dtype=np.int64), places=np.empty((0, 2)), arms=np.empty((0, 2)), normals=np.empty((0, 2)),
    slants=np.empty(0), qualities=np.empty(0), shares=np.empty(0), by_run=np.empty((0, 2, 2)),
)  # fmt: skip
