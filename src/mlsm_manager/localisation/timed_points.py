"""Points with the times of their beams: all that the map needs of a cloud."""

from dataclasses import dataclass
from typing import Sequence

import numpy as np

from mlsm_manager.scan_matching.scan import Scan


@dataclass(frozen=True)
class TimedPoints:
    """points: (n, 4) float64, x y z [m] in odom and echo strength. times: (n,) s. end: s, stamp of the newest beam."""

    points: np.ndarray
    times: np.ndarray
    end: float

    @classmethod
    def from_stamps(cls, points: np.ndarray, time_stamps: np.ndarray, end: float) -> "TimedPoints":
        """Build from a cloud's points (n, 4) and signed time stamps (n,); points that are not finite are left out."""
        points = np.asarray(points, dtype=np.float64)
        stamps = np.asarray(time_stamps, dtype=np.float64)
        valid = np.isfinite(points).all(axis=1) & np.isfinite(stamps)
        return cls(points[valid], np.abs(stamps[valid]), end)

    @classmethod
    def of_scan(cls, scan: Scan) -> "TimedPoints":
        """Return the points of a scan."""
        return cls(scan.points, scan.times, scan.reference_time)

    @classmethod
    def joined(cls, clouds: "Sequence[TimedPoints]") -> "TimedPoints":
        """Return the points of clouds (at least one), one after the other, as one cloud."""
        points, times = ([getattr(cloud, name) for cloud in clouds] for name in ("points", "times"))
        return cls(np.concatenate(points), np.concatenate(times), max(cloud.end for cloud in clouds))

    def __len__(self) -> int:
        return len(self.points)
