"""Puts the nodes of a run onto the ways that a vehicle most likely went."""

import numpy as np

from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.motion.heading_factors import AHEAD, ASIDE
from mlsm_manager.joint_solver.motion.odometry_motion import Motion
from mlsm_manager.joint_solver.parameters import MultiViewParameters
from mlsm_manager.joint_solver.unknowns.state import YAW
from mlsm_manager.joint_solver.ways.way_search import WaySearch
from node_support.geometry import rotated

_ASTRAY = 1.0  # m, mean distance of the free nodes from the ways: farther off, they are at a wrong place


def nodes_on_ways(
    search: WaySearch, log: RunLog, nodes: np.ndarray, parameters: MultiViewParameters, is_told: bool
) -> np.ndarray:
    """Return the newest of `nodes` (n, width), those of the last turn or all free ones, moved onto the ways.

    All are moved where those before the last turn are far from the ways. is_told: whether the place of the first node
    was told; the ways then do not know where they lie in the map, and begin where the free nodes do.
    """
    path = search.ways.most_believed()
    free = min(len(path), parameters.window.free_nodes, len(nodes))
    parts = min(parameters.matching.scan_parts, free - 1)
    path, motion = path[-free:], log.node_motion(np.arange(len(nodes) - free, len(nodes)))
    places = motion.poses[:, :2] + nodes[-free:, :2]
    if is_told:
        path = path + places[0] - path[0]
    apart = np.hypot(*(places - path)[:-parts].T)
    if apart.mean() > _ASTRAY:
        return on_path(nodes[-free:], path, motion)
    path = path + (places - path)[-parts - 1]
    return on_path(nodes[-free:], path, motion)[-parts:]


def on_path(nodes: np.ndarray, path: np.ndarray, motion: Motion) -> np.ndarray:
    """Return `nodes` (k, width), k > 1, at the places `path` (k, 2) in map, with the speeds of that path."""
    moved = nodes.copy()
    moved[:, :2] = path - motion.poses[:, :2]
    speeds = rotated(np.gradient(path, motion.times, axis=0), -(motion.poses[:, 2] + nodes[:, YAW]))
    moved[:, [AHEAD, ASIDE]] = speeds
    return moved
