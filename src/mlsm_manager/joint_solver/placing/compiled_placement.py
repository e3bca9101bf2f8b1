"""Places points of scans by a compiled loop: as in `placement` but for rounding. Raises ImportError without numba."""

import numpy as np

from mlsm_manager.joint_solver.compiled.compiled_places import placed_rows
from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.measured.surface_points import SurfacePoints
from mlsm_manager.joint_solver.motion.odometry_model import OdometryModel
from mlsm_manager.joint_solver.motion.odometry_motion import Motion
from mlsm_manager.joint_solver.placing.path import NodePath
from mlsm_manager.joint_solver.placing.placement import HALF_SECOND, PlacedPoints, placed
from mlsm_manager.joint_solver.unknowns.state import DELAY, RANGE_SCALE, YAW, State


def placed_compiled(
    log: RunLog, odometry: OdometryModel, state: State, points: SurfacePoints, scans: np.ndarray
) -> PlacedPoints:
    """Return points of `scans` (n,) in the map; see placement.Placing."""
    if not len(points):
        return placed(log, odometry, state, points, scans)
    times = points.times + state.run[DELAY]
    nodes = np.unique(np.concatenate([scans, scans + 1]))
    path = NodePath(odometry, log.odometry, log.node_times[nodes], state.nodes[nodes])
    known = log.odometry.between(times.min() - HALF_SECOND, times.max() + HALF_SECOND)
    rows = placed_rows(
        times, np.searchsorted(nodes, scans), points.ranges, points.bearings, points.normals, log.sonar_in_base,
        float(state.run[RANGE_SCALE]), path.table, _knots(odometry, known), HALF_SECOND,
    )  # fmt: skip
    return PlacedPoints(
        scans=scans, places=rows[:, 0:2], arms=rows[:, 2:4], normals=rows[:, 4:6], slants=points.slants,
        qualities=points.qualities, shares=rows[:, 10], by_run=rows[:, 6:10].reshape(-1, 2, 2),
    )  # fmt: skip


def _knots(odometry: OdometryModel, known: Motion) -> np.ndarray:
    """Return poses of the odometry (k, 4) as `compiled_places` takes them: a reference path is even between them."""
    reference = odometry.reference(known)
    return np.column_stack([known.times, known.poses[:, YAW], reference.real, reference.imag])
