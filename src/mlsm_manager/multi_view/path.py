"""The vehicle's path at any time: as it was known then, or as it is known from the whole run."""

from typing import Sequence

import numpy as np

from mlsm_manager.matching.problem.scan import Track
from mlsm_manager.multi_view.dvl_factors import DvlFactors
from mlsm_manager.multi_view.estimate import LiveEstimate


def live_path(
    track: Track, estimates: Sequence[LiveEstimate], odometry: DvlFactors, latency: float, times: np.ndarray
) -> np.ndarray:
    """Return T_map_base (m, 3) at `times` (m,) as it was known at each: the newest estimate, continued by odometry.

    An estimate is known `latency` seconds after its scan; before the first one the odometry is all there is.
    """
    poses = track.at(times)
    if not estimates:
        return poses
    known_from = np.array([estimate.time for estimate in estimates]) + latency
    newest = np.searchsorted(known_from, times, side="right") - 1
    nodes = np.array([estimate.node for estimate in estimates])[newest]
    before = np.array([estimate.T_odom_base for estimate in estimates])[newest]
    return np.where((newest >= 0)[:, np.newaxis], odometry.continued(nodes, before, poses), poses)


def solved_path(track: Track, node_times: np.ndarray, nodes: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return T_map_base (m, 3) at `times` (m,): the odometry with the nodes' corrections, linearly between them.

    node_times: (n,) s. nodes: (n, >= 3) corrections.
    """
    correction = [np.interp(times, node_times, nodes[:, column]) for column in range(3)]
    return track.at(times) + np.stack(correction, axis=-1)
