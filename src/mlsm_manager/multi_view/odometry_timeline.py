"""The odometry's poses over the whole run, as far as they are known."""

import numpy as np

from mlsm_manager.matching.problem.scan import Track
from mlsm_manager.multi_view.growing import GrowingArray


class OdometryTimeline:
    """Poses T_odom_base in the order of time; grows at its end, and yaw never jumps by a turn."""

    def __init__(self) -> None:
        self._times = GrowingArray()
        self._poses = GrowingArray(3)

    def __len__(self) -> int:
        return len(self._times)

    def shorten(self, count: int) -> None:
        """Keep the oldest `count` poses."""
        self._times.shorten(count)
        self._poses.shorten(count)

    @property
    def end(self) -> float:
        """Time of the newest pose [s]; minus infinity without any."""
        return float(self._times.values[-1]) if len(self._times) else -np.inf

    def extend(self, track: Track, until: float) -> None:
        """Append the poses of `track` that are newer than the newest known one and not after `until` [s]."""
        first = int(np.searchsorted(track.times, self.end, side="right"))
        last = int(np.searchsorted(track.times, until, side="right"))
        if last <= first:
            return
        poses = track.poses[first:last].copy()
        if len(self._poses):
            jump = poses[0, 2] - self._poses.values[-1, 2]
            poses[:, 2] -= 2.0 * np.pi * np.round(jump / (2.0 * np.pi))
        self._times.extend(track.times[first:last])
        self._poses.extend(poses)

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return T_odom_base (..., 3) at `times` (...), linearly between the known poses; the nearest beyond them."""
        known, poses = self._times.values, self._poses.values
        return np.stack([np.interp(times, known, poses[:, axis]) for axis in range(3)], axis=-1)
