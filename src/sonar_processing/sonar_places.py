"""Where the sonar was when the beams of a scan were taken, by tf."""

import time

import genpy
import numpy as np
import rospy
import tf2_ros

from node_support.refused_input import RefusedInput
from sonar_processing.transform_filter import JUMP_BACK

_CACHE = 300.0
_PATIENCE = 0.5


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
        """Return (m, 2) x y [m] of the sonar in `frame_id` at `times` (m,) [s].

        Raises RefusedInput when tf does not know all of them within half a second.
        """
        distinct, index = np.unique(times, return_inverse=True)
        places = np.array([self._place(frame_id, seconds) for seconds in distinct]).reshape(-1, 2)
        return places[index]

    def _place(self, frame_id: str, seconds: float) -> tuple:
        stamp = genpy.Time.from_sec(seconds)
        try:
            found = self._lookup(frame_id, stamp).transform.translation
        except tf2_ros.TransformException as error:
            raise RefusedInput("scans without sonar position", f"{self._frame} in {frame_id}: {error}") from error
        return found.x, found.y

    def _lookup(self, frame_id: str, stamp: genpy.Time) -> object:
        if not self._buffer.can_transform_core(frame_id, self._frame, stamp)[0]:
            deadline = time.monotonic() + _PATIENCE
            while time.monotonic() < deadline and not rospy.core.is_shutdown_requested():
                if self._buffer.can_transform_core(frame_id, self._frame, stamp)[0]:
                    break
                time.sleep(0.02)
        return self._buffer.lookup_transform_core(frame_id, self._frame, stamp)
