"""The correction map -> odom for an odometry without stamps, as a static transform is."""

from typing import Callable, NamedTuple, Optional

import numpy as np

from mlsm_manager.localisation.live_correction import LiveCorrection


class _Arrival(NamedTuple):
    """Of a scan: its own time [s], and when it came by the clock [s]."""

    scan_time: float
    came_at: float


class StandingCorrection:
    """Blends in a new correction by the wall clock after each scan, and then holds it.

    Such an odometry says nothing of the time between scans. Safe to use from several threads.
    """

    def __init__(self, live: LiveCorrection, clock: Callable[[], float]) -> None:
        """`clock`: s, tells how long ago the newest scan came."""
        self._live = live
        self._clock = clock
        self.forget()

    def forget(self) -> None:
        """Forget the newest scan."""
        self._newest: Optional[_Arrival] = None

    def take_scan_time(self, time: float) -> None:
        """Learn that a scan of `time` [s] came now."""
        self._newest = _Arrival(time, self._clock())

    def sample(self, odometry: np.ndarray) -> Optional[np.ndarray]:
        """Return T_map_odom (3,) to be shown now, where the odometry says T_odom_base (3,); None before any scan."""
        newest = self._newest
        if newest is None:
            return None
        seconds = min(max(self._clock() - newest.came_at, 0.0), self._live.blend_time)
        return self._live.sample(newest.scan_time + seconds, odometry)
