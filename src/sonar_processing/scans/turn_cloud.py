"""A turn of the head as one cloud in the sonar's own frame, for mappers that take clouds with a time per point."""

import numpy as np

from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.polar_scan import PolarScan

TURN_FIELDS = ("x", "y", "z", "intensity", "time")


def turn_cloud(scan: PolarScan, parameters: SonarToCloudParameters) -> np.ndarray:
    """Return (n, 5) float32, the columns `TURN_FIELDS`: all kept bins, seen from the newest beam's pose.

    Each bin is placed by the pose of its own beam, so that the vehicle's motion no longer bends the turn. Times are in
    s after the newest beam, and so never above 0.
    """
    beams, bins = np.nonzero(scan.kept(parameters))
    points = np.ones((beams.size, 4))
    points[:, :3] = scan.origins[beams] + scan.directions[beams] * scan.ranges[bins, np.newaxis]
    T_newest_target = np.linalg.inv(scan.T_target_sonar[-1])
    seconds = np.abs(scan.time_stamps)
    columns = [(points @ T_newest_target.T)[:, :3], scan.strengths[beams, bins], (seconds - seconds[-1])[beams]]
    return np.column_stack(columns).astype(np.float32)
