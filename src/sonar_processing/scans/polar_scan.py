"""A whole turn of the head as a polar image whose beams have their own poses."""

from dataclasses import dataclass
from typing import List

import numpy as np

from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.beams.projection import beam_directions, bin_points, kept_bins
from sonar_processing.cloud import IntensityCloud
from sonar_processing.scans.parameters import SonarToCloudParameters


@dataclass(frozen=True)
class PolarScan:
    """Beams of one turn, oldest first.

    strengths: (beams, bins) uint8. angles: (beams,) head angles, rad. T_target_sonar: (beams, 4, 4), where each beam
    was sent from. time_stamps: (beams,) s, negative while the vehicle was still. range_resolution: length of a bin, m.
    sonar_frame: the sonar's own frame. stamp_ns: of the newest beam.
    """

    strengths: np.ndarray
    angles: np.ndarray
    T_target_sonar: np.ndarray
    time_stamps: np.ndarray
    range_resolution: float
    sonar_frame: str
    stamp_ns: int

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
        )

    @property
    def ranges(self) -> np.ndarray:
        """(bins,) distance of each bin's centre, m."""
        return (np.arange(self.strengths.shape[1]) + 0.5) * self.range_resolution

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
        return kept_bins(self.ranges, heights, parameters.min_range, parameters.height_limit)

    def cloud(self, parameters: SonarToCloudParameters) -> IntensityCloud:
        """Return the organised cloud of all bins in the target frame: rows are beams, removed bins are NaN."""
        beams, bins = self.strengths.shape
        points = bin_points(self.origins, self.directions, self.ranges, self.strengths)
        points[~self.kept(parameters)] = np.nan
        return IntensityCloud(
            points=points.reshape(-1, 4),
            time_stamps=np.repeat(self.time_stamps, bins),
            stamp_ns=self.stamp_ns,
            frame_id=parameters.target_frame,
            height=beams,
            organized=True,
        )
