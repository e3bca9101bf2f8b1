"""The vehicle's way by odometry, from tf."""

from typing import Optional, Tuple

import numpy as np

from mlsm_manager.scan_matching.scan import Track
from node_support.errors import RefusedInput
from node_support.health import Health
from node_support.ros.transforms import TfBuffer, stamp_of

_CACHE = 180.0  # s that tf remembers: three slow turns of the head
_PATIENCE = 1.0  # s to wait for odometry that is on its way; then the scan is given up
_STEADY = 65  # times of a track besides those of the beams: four a second in a turn of 16 s


class OdometryTrack:
    """Looks up odom -> base_link at many times; `tf`: where. name: as which its silence is told."""

    def __init__(self, odom_frame: str, base_frame: str, health: Health, stamp_tolerance: float) -> None:
        """`stamp_tolerance`: how far stamps may be from odometry and clock, s."""
        self._frames = odom_frame, base_frame
        self.name = f"tf of {odom_frame} -> {base_frame}"
        self._health = health
        self._newest_ns: Optional[int] = None
        health.expect(self.name)
        self.tf = TfBuffer(health, _CACHE, stamp_tolerance, parent=odom_frame)

    def track(self, start: float, times: np.ndarray, end: float, lookahead: float = 0.0) -> Track:
        """Return the track from `start` to `end` and, where it is known, `lookahead` beyond [s], exact at `times` (n,).

        What tf no longer knows of the past is left out. Raises RefusedInput when tf does not learn the vehicle's place
        at `end` within a second.
        """
        self.tf.wait_for(*self._frames, stamp_of(end + lookahead), _PATIENCE + lookahead)
        obstacle = self.tf.wait_for(*self._frames, stamp_of(end), 0.0)
        if obstacle:
            raise self._without_odometry(obstacle)
        steady = np.append(np.linspace(start, end, _STEADY), end + lookahead)
        wanted = np.unique(np.concatenate([steady, times[(times >= start) & (times <= end)]]))
        known, poses = [], []
        for time in wanted:
            try:
                poses.append(planar(self.matrix(time)))
            except RefusedInput:
                continue
            known.append(time)
        if not known:
            raise self._without_odometry(f"nothing from {start:.3f} to {end:.3f} s")
        return Track(np.array(known), np.array(poses))

    def matrix(self, time: float) -> np.ndarray:
        """Return the (4, 4) T_odom_base at `time` [s], which a track has been made of."""
        return self.tf.matrix(*self._frames, stamp_of(time))

    def place_on_vehicle(self, frame: str, time: float) -> Optional[np.ndarray]:
        """Return (2,) x y [m] of `frame` in base_link at `time` [s]; None where tf does not know it."""
        try:
            return self.tf.matrix(self._frames[1], frame, stamp_of(time))[:2, 3]
        except RefusedInput:
            return None

    def newest(self) -> Optional[Tuple[Optional[float], np.ndarray]]:
        """Return the time [s] and T_odom_base (4, 4) that tf knows last; None when it knows none.

        Static transforms hold at all times and have none of their own: the time is then None.
        """
        found = self.tf.newest(*self._frames)
        if found is None:
            return None
        stamp_ns, matrix = found
        if stamp_ns != self._newest_ns:
            self._newest_ns = stamp_ns
            self._health.heard(self.name)
        return (stamp_ns * 1e-9 if stamp_ns else None), matrix

    def _without_odometry(self, reason: str) -> RefusedInput:
        return RefusedInput("scans without odometry", f"from {self._frames[1]} to {self._frames[0]}: {reason}")


def planar(matrix: np.ndarray) -> np.ndarray:
    """Return x, y [m] and yaw [rad] (3,) of a pose (4, 4)."""
    return np.array([matrix[0, 3], matrix[1, 3], np.arctan2(matrix[1, 0], matrix[0, 0])])
