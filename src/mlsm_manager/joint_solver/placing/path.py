"""The vehicle's path at any time: as it was known then, or as it is known from the whole run."""

import numpy as np

from mlsm_manager.joint_solver.measured.odometry_log import Motion, OdometryLog, as_complex, product
from mlsm_manager.joint_solver.motion.motion_models import OdometryModel, turned
from mlsm_manager.joint_solver.unknowns.state import YAW
from mlsm_manager.scan_matching.scan import Track


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
        motion, near = self._timeline.motion(times), self._timeline.motion(inside)
        poses = self._poses_of(near, legs)
        after = times > last
        gain = np.where(after, self._last_gain, self._gain[0])
        beyond = product(gain, turned(self._nodes[np.where(after, -1, 0), YAW]))
        beyond = product(beyond, self._odometry.reference(motion) - self._odometry.reference(near))
        turn = motion.poses[:, 2] - near.poses[:, 2]
        return poses + np.column_stack([beyond.real, beyond.imag, turn])

    def _poses_of(self, motion: Motion, legs: np.ndarray) -> np.ndarray:
        """Return the poses (m, 3) at times between nodes `legs` (m,) and the next ones."""
        share = (motion.times - self._times[legs]) / (self._times[legs + 1] - self._times[legs])
        yaw = (1.0 - share) * self._nodes[legs, YAW] + share * self._nodes[legs + 1, YAW]
        from_node = self._odometry.reference(motion) - self._reference[legs]
        bow = from_node - share * (self._reference[legs + 1] - self._reference[legs])
        bow = product(product(self._gain[legs], turned(yaw)), bow)
        place = (1.0 - share) * self._places[legs] + share * self._places[legs + 1] + bow
        return np.column_stack([place.real, place.imag, motion.poses[:, 2] + yaw])


def solved_path(
    track: Track, odometry: OdometryModel, node_times: np.ndarray, nodes: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """Return T_map_base (m, 3) at `times` (m,): the path through the nodes.

    node_times: (n,) s. nodes: (n, width).
    """
    return NodePath(odometry, OdometryLog.of(track), node_times, nodes).at(times)
