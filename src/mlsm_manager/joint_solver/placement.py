"""Where the vehicle was at any time, and where the points of scans lie in the map, given the unknowns."""

from dataclasses import dataclass, fields, replace
from typing import Union

import numpy as np

from mlsm_manager.joint_solver.compiled_placement import placed_rows
from mlsm_manager.joint_solver.motion_models import OdometryModel
from mlsm_manager.joint_solver.normal_equations import DELAY, RANGE_SCALE, YAW, State
from mlsm_manager.joint_solver.odometry_log import Motion, OdometryLog, as_complex, stretched
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.surface_points import SurfacePoints
from mlsm_manager.scan_matching.scan import Track

_HALF_SECOND = 0.5  # the velocity of a point is averaged over one second, longer than the odometry's period


class NodePath:
    """The path between nodes: the model's reference path, turned and scaled, stretched from node to node."""

    def __init__(self, odometry: OdometryModel, timeline: OdometryLog, times: np.ndarray, nodes: np.ndarray) -> None:
        """times: (n,) s of the nodes, n > 1. nodes: (n, width)."""
        self._odometry, self._timeline, self._times, self._nodes = odometry, timeline, times, nodes
        motion = timeline.motion(times)
        self._places = as_complex(motion.poses[:, :2] + nodes[:, :2])
        self._reference = odometry.reference(motion)
        gain = odometry.gain(nodes)
        self._gain, self._last_gain = (gain[:-1] + gain[1:]) / 2.0, gain[-1:]

    @property
    def table(self) -> np.ndarray:
        """(n, 8): times of the nodes, places x y, yaw, reference path x y, and the gain x y from each to the next."""
        gain = np.append(self._gain, self._last_gain)
        columns = (self._times, self._places, self._nodes[:, YAW], self._reference, gain)
        parts = [(one.real, one.imag) if np.iscomplexobj(one) else (one,) for one in columns]
        return np.column_stack([part for pair in parts for part in pair])

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return T_map_base (m, 3) at any `times` (m,) [s]; before the first node and after the last as it goes on."""
        first, last = self._times[0], self._times[-1]
        inside = np.clip(times, first, last)
        legs = np.clip(np.searchsorted(self._times, inside, side="right") - 1, 0, len(self._times) - 2)
        near = self._timeline.motion(inside)
        reference = self._odometry.reference(near)
        poses = self._poses_of(near, reference, legs)
        if np.array_equal(inside, times):
            return poses
        motion, after = self._timeline.motion(times), times > last
        gain, yaw = np.where(after, self._last_gain, self._gain[0]), self._nodes[np.where(after, -1, 0), YAW]
        beyond = stretched(self._odometry.reference(motion) - reference, gain, yaw)
        turn = motion.poses[:, 2] - near.poses[:, 2]
        return poses + np.column_stack([beyond.real, beyond.imag, turn])

    def _poses_of(self, motion: Motion, reference: np.ndarray, legs: np.ndarray) -> np.ndarray:
        """Return the poses (m, 3) at times between nodes `legs` (m,) and the next; `reference`: (m,) of the times."""
        share = (motion.times - self._times[legs]) / (self._times[legs + 1] - self._times[legs])
        yaw = (1.0 - share) * self._nodes[legs, YAW] + share * self._nodes[legs + 1, YAW]
        from_node = reference - self._reference[legs]
        bow = from_node - share * (self._reference[legs + 1] - self._reference[legs])
        bow = stretched(bow, self._gain[legs], yaw)
        place = (1.0 - share) * self._places[legs] + share * self._places[legs + 1] + bow
        return np.column_stack([place.real, place.imag, motion.poses[:, 2] + yaw])


def solved_path(
    track: Track, odometry: OdometryModel, node_times: np.ndarray, nodes: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """Return T_map_base (m, 3) at `times` (m,): the path through the nodes.

    node_times: (n,) s. nodes: (n, width).
    """
    return NodePath(odometry, OdometryLog.of(track), node_times, nodes).at(times)


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
    """Return poses of the odometry (k, 4) as `placed_rows` takes them: a reference path is even between them."""
    reference = odometry.reference(known)
    return np.column_stack([known.times, known.poses[:, YAW], reference.real, reference.imag])


_NO_POINTS = PlacedPoints(
    scans=np.empty(0, dtype=np.int64), places=np.empty((0, 2)), arms=np.empty((0, 2)), normals=np.empty((0, 2)),
    slants=np.empty(0), qualities=np.empty(0), shares=np.empty(0), by_run=np.empty((0, 2, 2)),
)  # fmt: skip
