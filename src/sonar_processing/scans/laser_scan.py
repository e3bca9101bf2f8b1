"""A turn of the head as a planar laser would have measured it, for mappers that know nothing of slow heads."""

import math
from dataclasses import dataclass
from typing import Tuple

import numpy as np

from node_support.geometry import FULL_TURN, wrapped
from sonar_processing.scans.laser_pick import picked_bins
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.polar_scan import PolarScan

MOST_RAYS = 7200  # As many as `laser_scan_rays` allows; smaller steps are rounding of a head that stands still


@dataclass(frozen=True)
class PlanarLaserScan:
    """Ranges all around the sonar as they are at one moment, that of the newest beam.

    ranges: (rays,) float32 m, inf where nothing was measured; ray i points to -pi + i * angle_increment about +z of
    the sonar. intensities: (rays,) float32 echo strengths, 0 where there is no range. duration: of the turn, s.
    """

    ranges: np.ndarray
    intensities: np.ndarray
    range_min: float
    range_max: float
    duration: float

    @property
    def angle_increment(self) -> float:
        """Angle between rays, rad."""
        return FULL_TURN / self.ranges.size


def planar_laser_scan(scan: PolarScan, parameters: SonarToCloudParameters) -> PlanarLaserScan:
    """Return the scan as rays around the sonar's pose at its newest beam.

    A turn takes seconds and the vehicle moves meanwhile. Each beam's echo is therefore placed by the beam's own pose,
    and seen from the newest one; of several echoes in one ray the nearest stays. Beams may come in any direction.
    """
    echoes, strengths = _echoes_from_newest_pose(scan, parameters)
    rays = parameters.laser_scan_rays or usual_rays(scan.angles)
    ranges = np.hypot(echoes[:, 0], echoes[:, 1])
    range_max = scan.strengths.shape[1] * scan.range_resolution
    inside = (ranges >= parameters.min_range) & (ranges <= range_max)
    farthest_first = np.flatnonzero(inside)[np.argsort(-ranges[inside], kind="stable")]
    bearings = np.arctan2(echoes[farthest_first, 1], echoes[farthest_first, 0])
    ray = np.rint((bearings + math.pi) * rays / FULL_TURN).astype(np.int64) % rays
    result = np.full(rays, np.inf, dtype=np.float32), np.zeros(rays, dtype=np.float32)
    result[0][ray], result[1][ray] = ranges[farthest_first], strengths[farthest_first]
    seconds = np.abs(scan.time_stamps)
    return PlanarLaserScan(*result, parameters.min_range, range_max, float(seconds[-1] - seconds[0]))


def usual_rays(angles: np.ndarray) -> int:
    """Return how many steps of the usual size between `angles` (n,) [rad] make a turn; 1 when the head stands still."""
    steps = np.abs(wrapped(np.diff(angles)))
    steps = steps[steps > FULL_TURN / MOST_RAYS]
    return round(FULL_TURN / float(np.median(steps))) if steps.size else 1


def _echoes_from_newest_pose(scan: PolarScan, parameters: SonarToCloudParameters) -> Tuple[np.ndarray, np.ndarray]:
    bins, found = picked_bins(scan.strengths, scan.kept(parameters), parameters)
    beams = np.flatnonzero(found)
    bins = bins[beams]
    points = np.ones((beams.size, 4))
    points[:, :3] = scan.origins[beams] + scan.directions[beams] * scan.ranges[bins, np.newaxis]
    T_newest_target = np.linalg.inv(scan.T_target_sonar[-1])
    return (points @ T_newest_target.T)[:, :3], scan.strengths[beams, bins].astype(np.float32)
