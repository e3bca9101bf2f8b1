"""Where clouds lie in map that come beside the scans."""

from collections import deque
from dataclasses import dataclass
from typing import Deque, Optional, Protocol, Tuple

import numpy as np

from mlsm_manager.scan_matching.scan import MapCloud, Track
from node_support.geometry import move_of, transformed

PATH_POINTS = 17  # of the path within a scan: about one per second of a slow head's revolution
_MOST_STRETCHES = 8  # a cloud comes within a scan or two of its own; eight turns of a head are two minutes
_SLACK = 0.5  # s by which a cloud may reach beyond the known scans: a few beams, in which a vehicle moves decimetres


class Placement(Protocol):
    """Places clouds as it is known now: the joint solver's Solution, or a run in a map that had another odometry."""

    def path(self, times: np.ndarray) -> np.ndarray:
        """Return T_map_base (m, 3) at `times` (m,) [s]."""

    def heard(self, cloud: MapCloud) -> Tuple[np.ndarray, np.ndarray]:
        """Return the points (n, 4) of a cloud in map, and where the sonar was when it heard each, (n, 2) m."""


@dataclass(frozen=True)
class _Stretch:
    """times: (b,) s. corrections: (b, 3) T_map_odom. poses: (b, 3) T_map_base.

    holds: whether the scan of this time was placed in the map.
    """

    times: np.ndarray
    corrections: np.ndarray
    poses: np.ndarray
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
        corrections = move_of(track.at(times), poses)
        self._stretches.append(_Stretch(times, corrections, poses, holds))

    def placed(self, cloud: MapCloud) -> Tuple[np.ndarray, np.ndarray]:
        """Return those of the cloud's points whose time has a place, (k, 4) in map, and the times of their beams (k,).

        Between two stretches the nearer one's end counts.
        """
        if not self._stretches:
            return np.empty((0, 4)), np.empty(0)
        times = np.concatenate([stretch.times for stretch in self._stretches])
        corrections = np.concatenate([stretch.corrections for stretch in self._stretches])
        holds = np.concatenate([np.full(len(stretch.times), stretch.holds) for stretch in self._stretches])
        nearest = np.clip(np.searchsorted(times, cloud.times), 0, len(times) - 1)
        keep = holds[nearest]
        chosen = cloud.times[keep]
        path = np.column_stack([np.interp(chosen, times, corrections[:, axis]) for axis in range(3)])
        return transformed(path, cloud.points[keep]), chosen

    def reaches(self, times: np.ndarray) -> bool:
        """Return whether all of `times` (n,) [s], n > 0, are known or from before the history begins."""
        return bool(times.max() <= self.end + _SLACK)

    def origins(self, times: np.ndarray, sonar_in_base: np.ndarray) -> Optional[np.ndarray]:
        """Return where a sonar at (2,) m in base_link was in map at `times` (n,), (n, 2) m.

        None where not all of them are known.
        """
        if not self._stretches or not len(times):
            return None
        known = np.concatenate([stretch.times for stretch in self._stretches])
        if times.min() < known[0] - _SLACK or not self.reaches(times):
            return None
        poses = np.concatenate([stretch.poses for stretch in self._stretches])
        places = transformed(poses, np.broadcast_to(sonar_in_base, (len(poses), 2)))
        return np.column_stack([np.interp(times, known, places[:, axis]) for axis in range(2)])
