"""A whole turn of the head as a polar image whose beams have their own poses, and what other mappers take of it."""

import math
from dataclasses import dataclass
from typing import List, Tuple

import numpy as np

from node_support.geometry import FULL_TURN, bearings_of, wrapped
from sonar_processing.beams.beam import PlacedBeam, beam_directions, bin_points
from sonar_processing.cloud import Cloud
from sonar_processing.scans.parameters import LaserPick, SonarToCloudParameters

MOST_RAYS = 7200  # As many as `laser_scan_rays` allows; smaller steps are rounding of a head that stands still
TURN_FIELDS = ("x", "y", "z", "intensity", "time")


@dataclass(frozen=True)
class PolarScan:
    """Beams of one turn, oldest first.

    strengths: (beams, bins) uint8. angles: (beams,) head angles, rad. T_target_sonar: (beams, 4, 4), where each beam
    was sent from. time_stamps: (beams,) s, negative while the vehicle was still. range_resolution: length of a bin, m.
    sonar_frame: the sonar's own frame. stamp_ns: of the newest beam. bin_place: see Beam.
    """

    strengths: np.ndarray
    angles: np.ndarray
    T_target_sonar: np.ndarray
    time_stamps: np.ndarray
    range_resolution: float
    sonar_frame: str
    stamp_ns: int
    bin_place: float = 0.5

    @classmethod
    def of(cls, beams: List[PlacedBeam]) -> "PolarScan":
        """Return the scan of beams that all have the same bins; at least one."""
        newest = beams[-1].beam
        return cls(
            strengths=np.stack([placed.beam.intensities for placed in beams]),
            angles=np.array([placed.beam.angle for placed in beams]),
            T_target_sonar=np.stack([placed.T_target_sonar for placed in beams]),
            time_stamps=np.array([placed.signed_stamp for placed in beams]),
            range_resolution=newest.range_resolution,
            sonar_frame=newest.frame_id,
            stamp_ns=newest.stamp_ns,
            bin_place=newest.bin_place,
        )

    @property
    def ranges(self) -> np.ndarray:
        """(bins,) distance at which the echoes of each bin are drawn, m."""
        return (np.arange(self.strengths.shape[1]) + self.bin_place) * self.range_resolution

    @property
    def directions(self) -> np.ndarray:
        """(beams, 3) unit vectors along the beams, in the target frame."""
        return beam_directions(self.angles, self.T_target_sonar)

    @property
    def origins(self) -> np.ndarray:
        """(beams, 3) where each beam was sent from, in the target frame."""
        return self.T_target_sonar[:, :3, 3]

    def kept(self, parameters: SonarToCloudParameters) -> np.ndarray:
        """Return (beams, bins) bool: which bins neither `min_range` nor `height_limit` removes."""
        heights = self.origins[:, 2:] + self.directions[:, 2:] * self.ranges
        return (self.ranges >= parameters.min_range) & (heights <= parameters.height_limit)

    def from_newest(self, beams: np.ndarray, bins: np.ndarray) -> np.ndarray:
        """Return (n, 3) m: the bins `bins` (n,) of `beams` (n,), seen from the sonar's pose at its newest beam."""
        points = np.ones((beams.size, 4))
        points[:, :3] = self.origins[beams] + self.directions[beams] * self.ranges[bins, np.newaxis]
        return (points @ np.linalg.inv(self.T_target_sonar[-1]).T)[:, :3]

    def cloud(self, parameters: SonarToCloudParameters) -> Cloud:
        """Return the organised cloud of all bins in the target frame: rows are beams, removed bins are NaN."""
        beams, bins = self.strengths.shape
        points = bin_points(self.origins, self.directions, self.ranges, self.strengths)
        points[~self.kept(parameters)] = np.nan
        return Cloud(
            points=points.reshape(-1, 4),
            time_stamps=np.repeat(self.time_stamps, bins),
            stamp_ns=self.stamp_ns,
            frame_id=parameters.target_frame,
            height=beams,
            organized=True,
        )


def picked_bins(
    strengths: np.ndarray, keep: np.ndarray, parameters: SonarToCloudParameters
) -> Tuple[np.ndarray, np.ndarray]:
    """Return the bin (beams,) of each beam, and (beams,) bool whether it holds an echo.

    strengths: (beams, bins); keep: (beams, bins) bool, the bins that may be taken. STRONGEST takes the nearest of
    equally strong ones.
    """
    heard = np.where(keep, strengths, -1.0)
    if parameters.laser_pick is LaserPick.FIRST:
        bins = np.argmax(heard > parameters.laser_first_above, axis=1)
        least = parameters.laser_first_above
    else:
        bins = np.argmax(heard, axis=1)
        least = parameters.laser_strongest_above
    return bins, heard[np.arange(len(heard)), bins] > least


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
    picked, found = picked_bins(scan.strengths, scan.kept(parameters), parameters)
    beams = np.flatnonzero(found)
    echoes, strengths = scan.from_newest(beams, picked[beams]), scan.strengths[beams, picked[beams]]
    rays = parameters.laser_scan_rays or usual_rays(scan.angles)
    ranges = np.hypot(echoes[:, 0], echoes[:, 1])
    range_max = scan.strengths.shape[1] * scan.range_resolution
    inside = (ranges >= parameters.min_range) & (ranges <= range_max)
    farthest_first = np.flatnonzero(inside)[np.argsort(-ranges[inside], kind="stable")]
    bearings = bearings_of(echoes[farthest_first])
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


def turn_cloud(scan: PolarScan, parameters: SonarToCloudParameters) -> np.ndarray:
    """Return (n, 5) float32, the columns `TURN_FIELDS`: all kept bins, seen from the newest beam's pose.

    Each bin is placed by the pose of its own beam, so that the vehicle's motion no longer bends the turn. Times are in
    s after the newest beam, and so never above 0.
    """
    beams, bins = np.nonzero(scan.kept(parameters))
    seconds = np.abs(scan.time_stamps)
    columns = [scan.from_newest(beams, bins), scan.strengths[beams, bins], (seconds - seconds[-1])[beams]]
    return np.column_stack(columns).astype(np.float32)
