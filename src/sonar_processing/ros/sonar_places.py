"""Where the sonar was when the beams of a scan were taken, by tf."""

import time
from typing import Tuple

import genpy
import numpy as np
import rospy
import tf2_ros

from node_support.errors import RefusedInput
from sonar_processing.ros.transform_filter import JUMP_BACK

_CACHE = 300.0
_PATIENCE = 0.5
_WAIT_STEP = 0.02


class SonarPlaces:
    """Remembers tf long enough for a slow scan, and forgets it when time jumps back."""

    def __init__(self, sonar_frame: str) -> None:
        self._frame = sonar_frame
        self._buffer = tf2_ros.Buffer(cache_time=rospy.Duration.from_sec(_CACHE), debug=False)
        self._listener = tf2_ros.TransformListener(self._buffer)
        self._newest = 0.0

    def use_time(self, seconds: float) -> None:
        """Note the time of a scan; one long before its predecessor's means that time jumped."""
        if seconds < self._newest - JUMP_BACK:
            self._buffer.clear()
        self._newest = seconds

    def at(self, frame_id: str, times: np.ndarray) -> np.ndarray:
        """Return (m, 2) x y [m] of the sonar in `frame_id` at `times` (m,) [s], NaN where tf does not know it.

        Waits up to half a second for the newest. Raises RefusedInput when tf knows none of them.
        """
        distinct, index = np.unique(times, return_inverse=True)
        self._wait_for(frame_id, distinct[-1])
        places = np.array([self._place(frame_id, seconds) for seconds in distinct])
        if np.isnan(places).all():
            reason = self._obstacle(frame_id, distinct[-1])
            raise RefusedInput("scans without sonar position", f"{self._frame} in {frame_id}: {reason}")
        return places[index]

    def _wait_for(self, frame_id: str, seconds: float) -> None:
        deadline = time.monotonic() + _PATIENCE
        while self._obstacle(frame_id, seconds) and time.monotonic() < deadline:
            if rospy.core.is_shutdown_requested():
                return
            time.sleep(_WAIT_STEP)

    def _obstacle(self, frame_id: str, seconds: float) -> str:
        known, reason = self._buffer.can_transform_core(frame_id, self._frame, genpy.Time.from_sec(seconds))
        return "" if known else reason or "unknown to tf"

    def _place(self, frame_id: str, seconds: float) -> Tuple[float, float]:
        if self._obstacle(frame_id, seconds):
            return np.nan, np.nan
        stamp = genpy.Time.from_sec(seconds)
        found = self._buffer.lookup_transform_core(frame_id, self._frame, stamp).transform.translation
        return found.x, found.y
