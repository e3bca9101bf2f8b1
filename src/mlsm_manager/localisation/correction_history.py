"""Which correction of the odometry holds at which time of the last scans, for clouds that come beside them."""

from collections import deque
from dataclasses import dataclass
from typing import Deque, Tuple

import numpy as np

from mlsm_manager.localisation.timed_points import TimedPoints
from mlsm_manager.matching.problem.scan import Track
from node_support.geometry.planar import composed, inverse, transformed

# A cloud comes within a scan or two of its own; eight turns of a head are two minutes.
_MOST_STRETCHES = 8


@dataclass(frozen=True)
class _Stretch:
    """times: (b,) s. corrections: (b, 3) T_map_odom. holds: whether the scan of this time was placed in the map."""

    times: np.ndarray
    corrections: np.ndarray
    holds: bool


class CorrectionHistory:
    """The stretches of time of the last scans, with the paths that were found for them."""

    def __init__(self) -> None:
        self._stretches: Deque[_Stretch] = deque(maxlen=_MOST_STRETCHES)

    @property
    def end(self) -> float:
        """Newest time known, s; -inf when there is none."""
        return float(self._stretches[-1].times[-1]) if self._stretches else -np.inf

    def add(self, times: np.ndarray, poses: np.ndarray, track: Track, holds: bool) -> None:
        """Add the path T_map_base `poses` (b, 3) at increasing `times` (b,)."""
        corrections = composed(poses, inverse(track.at(times)))
        self._stretches.append(_Stretch(times, corrections, holds))

    def placed(self, cloud: TimedPoints) -> Tuple[np.ndarray, int]:
        """Return the points (k, 4) of `cloud` in map, and how many were left out because their time has no place.

        Between two stretches the nearer one's end counts.
        """
        if not self._stretches:
            return np.empty((0, 4)), len(cloud)
        times = np.concatenate([stretch.times for stretch in self._stretches])
        corrections = np.concatenate([stretch.corrections for stretch in self._stretches])
        holds = np.concatenate([np.full(len(stretch.times), stretch.holds) for stretch in self._stretches])
        nearest = np.clip(np.searchsorted(times, cloud.times), 0, len(times) - 1)
        keep = holds[nearest]
        chosen = cloud.times[keep]
        path = np.column_stack([np.interp(chosen, times, corrections[:, axis]) for axis in range(3)])
        return transformed(path, cloud.points[keep]), int(np.count_nonzero(~keep))
