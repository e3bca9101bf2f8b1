"""The vehicle's way by odometry, from tf."""

import threading
import time as wall
from typing import Optional, Tuple

import numpy as np
import rospy
import tf2_ros

from mlsm_manager.matching.problem.scan import Track
from node_support.errors import RefusedInput
from node_support.ros.conversions import matrix_from_message

# s that tf remembers: three slow turns of the head.
_CACHE = 180.0
# s to wait for odometry that is on its way; then the scan is given up.
_PATIENCE = 1.0
# s between two looks whether it came.
_POLL = 0.01
# Times of a track besides those of the beams: four a second in a turn of 16 s.
_STEADY = 65
# s: rounding of a time of today in a float is four times less.
_ROUNDING = 1e-6


class OdometryTrack:
    """Looks up odom -> base_link at many times."""

    def __init__(self, odom_frame: str, base_frame: str) -> None:
        self._frames = odom_frame, base_frame
        self._buffer = tf2_ros.Buffer(rospy.Duration(_CACHE), debug=False)
        self._listener = tf2_ros.TransformListener(self._buffer, queue_size=1000)
        self._pause = threading.Event()

    def clear(self) -> None:
        """Forget the past, because time jumped."""
        self._buffer.clear()

    def track(self, start: float, times: np.ndarray, end: float) -> Track:
        """Return the track from `start` to `end` [s], exact at `times` (n,).

        What tf no longer knows of the past is left out. Raises RefusedInput when tf does not learn the vehicle's place
        at `end` within a second.
        """
        self._wait_for(end)
        wanted = np.unique(np.concatenate([np.linspace(start, end, _STEADY), times[(times >= start) & (times <= end)]]))
        found = [(time, self._pose(time)) for time in wanted]
        known = [(time, pose) for time, pose in found if pose is not None]
        if not known:
            raise RefusedInput("scans without odometry", self._obstacle(end))
        return Track(np.array([time for time, _ in known]), np.array([pose for _, pose in known]))

    def matrix(self, time: float) -> np.ndarray:
        """Return the (4, 4) T_odom_base at `time` [s], which a track has been made of."""
        return matrix_from_message(self._buffer.lookup_transform_core(*self._frames, _stamp(time)).transform)

    def newest(self) -> Optional[Tuple[Optional[float], np.ndarray]]:
        """Return the time [s] and T_odom_base (3,) that tf knows last; None when it knows none.

        Static transforms hold at all times and have none of their own: the time is then None.
        """
        try:
            stamped = self._buffer.lookup_transform_core(*self._frames, rospy.Time(0))
        except tf2_ros.TransformException:
            return None
        stamp = stamped.header.stamp
        return None if stamp.is_zero() else stamp.to_sec(), _planar(matrix_from_message(stamped.transform))

    def _wait_for(self, end: float) -> None:
        deadline = wall.monotonic() + _PATIENCE
        while self._obstacle(end):
            if wall.monotonic() > deadline or rospy.is_shutdown():
                raise RefusedInput("scans without odometry", self._obstacle(end))
            self._pause.wait(_POLL)

    def _pose(self, time: float) -> Optional[np.ndarray]:
        try:
            return _planar(self.matrix(time))
        except tf2_ros.TransformException:
            return None

    def _obstacle(self, time: float) -> str:
        can, reason = self._buffer.can_transform_core(*self._frames, _stamp(time))
        frames = f"from {self._frames[1]} to {self._frames[0]}"
        return "" if can else f"{frames}: {reason or 'unknown to tf'}"


def _stamp(time: float) -> rospy.Time:
    # Seconds in a float are rounded; a moment earlier, so that tf's newest pose can be asked for at its own time.
    return rospy.Time.from_sec(max(time - _ROUNDING, 0.0))


def _planar(matrix: np.ndarray) -> np.ndarray:
    return np.array([matrix[0, 3], matrix[1, 3], np.arctan2(matrix[1, 0], matrix[0, 0])])
