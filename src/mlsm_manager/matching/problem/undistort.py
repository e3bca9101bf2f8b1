"""Puts the points of a matched scan where the matched path says they were."""

import numpy as np

from mlsm_manager.matching.problem.result import MatchResult
from mlsm_manager.matching.problem.scan import Scan
from node_support.geometry.planar import composed, inverse, transformed


def corrected_points(scan: Scan, result: MatchResult) -> np.ndarray:
    """Return (n, 4) points in map: each taken from the odometry's pose to the matched pose at its own beam's time."""
    path = np.stack([np.interp(scan.times, result.beam_times, column) for column in result.beam_poses.T], axis=-1)
    return transformed(composed(path, inverse(scan.track.at(scan.times))), scan.points)
