"""Where the sonar was when the points of a cloud were heard, by tf."""

import numpy as np

from node_support.errors import RefusedInput
from node_support.headers import DAY
from node_support.health import Health
from node_support.ros.transforms import TfBuffer, stamp_of

_CACHE = 300.0  # s: the slowest head takes minutes for a scan
_PATIENCE = 0.5  # s: transforms come at 2 Hz at least


class SonarPlaces:
    """Remembers tf long enough for a slow scan."""

    def __init__(self, sonar_frame: str, health: Health, stamp_tolerance: float = DAY) -> None:
        """`stamp_tolerance`: how far stamps may be from odometry and clock, s."""
        self._frame = sonar_frame
        self._transforms = TfBuffer(health, _CACHE, stamp_tolerance)

    def check_stamp(self, stamp_ns: int) -> None:
        """Raise RefusedInput for a stamp [ns] that is not near the newest odometry or the clock."""
        self._transforms.check_stamp(stamp_ns)

    def poses(self, frame_id: str, times: np.ndarray) -> np.ndarray:
        """Return T_frame_sonar (m, 4, 4) in `frame_id` at `times` (m,) [s], NaN where tf does not know it.

        Waits up to half a second for the newest. Raises RefusedInput when tf knows none of them.
        """
        distinct, index = np.unique(times, return_inverse=True)
        stamps = [stamp_of(seconds) for seconds in distinct]
        reason = self._transforms.wait_for(frame_id, self._frame, stamps[-1], _PATIENCE)
        poses = np.array([self._pose(frame_id, stamp) for stamp in stamps])
        if np.isnan(poses).all():
            raise RefusedInput("scans without sonar position", f"{self._frame} in {frame_id}: {reason}")
        return poses[index]

    def at(self, frame_id: str, times: np.ndarray) -> np.ndarray:
        """Return (m, 2) x y [m] of the sonar; see `poses`."""
        return self.poses(frame_id, times)[:, :2, 3]

    def _pose(self, frame_id: str, stamp_ns: int) -> np.ndarray:
        try:
            return self._transforms.matrix(frame_id, self._frame, stamp_ns)
        except RefusedInput:
            return np.full((4, 4), np.nan)
