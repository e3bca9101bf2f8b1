"""The odometry's poses over the whole run, as far as they are known."""

import numpy as np

from mlsm_manager.matching.scan import Track

_FIRST_CAPACITY = 1024


class OdometryTimeline:
    """Poses T_odom_base in the order of time; grows at its end, and yaw never jumps by a turn."""

    def __init__(self) -> None:
        self._times = np.empty(_FIRST_CAPACITY)
        self._poses = np.empty((_FIRST_CAPACITY, 3))
        self._count = 0

    @property
    def end(self) -> float:
        """Time of the newest pose [s]; minus infinity without any."""
        return float(self._times[self._count - 1]) if self._count else -np.inf

    def extend(self, track: Track, until: float) -> None:
        """Append the poses of `track` that are newer than the newest known one and not after `until` [s]."""
        first = int(np.searchsorted(track.times, self.end, side="right"))
        last = int(np.searchsorted(track.times, until, side="right"))
        if last <= first:
            return
        poses = track.poses[first:last].copy()
        if self._count:
            jump = poses[0, 2] - self._poses[self._count - 1, 2]
            poses[:, 2] -= 2.0 * np.pi * np.round(jump / (2.0 * np.pi))
        self._append(track.times[first:last], poses)

    def _append(self, times: np.ndarray, poses: np.ndarray) -> None:
        count = self._count + len(times)
        if count > len(self._times):
            capacity = max(count, 2 * len(self._times))
            self._times = np.concatenate([self._times[: self._count], np.empty(capacity - self._count)])
            self._poses = np.concatenate([self._poses[: self._count], np.empty((capacity - self._count, 3))])
        self._times[self._count : count] = times
        self._poses[self._count : count] = poses
        self._count = count

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return T_odom_base (..., 3) at `times` (...), linearly between the known poses; the nearest beyond them."""
        known, poses = self._times[: self._count], self._poses[: self._count]
        return np.stack([np.interp(times, known, poses[:, axis]) for axis in range(3)], axis=-1)
