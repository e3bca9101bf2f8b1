"""The correction map -> odom between scans, without jumps: the odometry's errors that were found go on."""

import math
import threading
from collections import deque
from typing import Deque, Optional, Tuple

import numpy as np

from mlsm_manager.scan_matching.prediction import Belief, Fading, advanced, advanced_path
from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.scan_matching.scan_path import POSE, RATE
from node_support.geometry import composed, inverse, wrapped
from node_support.timing import UsualInterval

# Of the odometry: a minute at 60 per second, longer than a scan and its match take.
_MOST_SAMPLES = 4000
_IDENTITY = np.zeros(3)


class LiveCorrection:
    """Follows the odometry from the last belief to now. A new belief is approached within `blend_time` seconds.

    Where a belief says how its rates fade, the vehicle is shown to come to rest once the next belief is overdue.

    Safe to use from several threads: one gives it beliefs, another asks for samples.
    """

    def __init__(self, blend_time: float) -> None:
        self.blend_time = blend_time
        self._lock = threading.RLock()
        self.clear()

    def clear(self) -> None:
        """Forget everything, because time jumped or the map is gone."""
        with self._lock:
            self.start = _IDENTITY
            self._samples: Deque[Tuple[float, np.ndarray]] = deque(maxlen=_MOST_SAMPLES)
            self._state: Optional[np.ndarray] = None
            self._state_time = -math.inf
            self._jump = _IDENTITY
            self._jump_time: Optional[float] = None
            self._shown: Optional[np.ndarray] = None
            self._fading: Optional[Fading] = None
            self._beliefs = UsualInterval()

    def start_from(self, correction: np.ndarray) -> None:
        """Show `correction` T_map_odom (3,) until the first belief."""
        with self._lock:
            self.start = np.array(correction, dtype=np.float64)

    def believe(self, belief: Belief) -> None:
        """Take what a match found at a time in the past; the samples since then bring it to now."""
        with self._lock:
            self._state, self._fading = np.array(belief.theta), belief.fading
            start = self._state_time = belief.time
            self._beliefs.take(start)
            later = [sample for sample in self._samples if sample[0] > belief.time]
            earlier = [sample for sample in self._samples if sample[0] <= belief.time]
            if later:
                known = earlier[-1:] + later
                times = np.array([time for time, _ in known])
                track = Track(times, np.array([pose for _, pose in known]))
                self._bring_on(start, track, times[times > start])
            if self._shown is not None and self._samples:
                self._jump = composed(inverse(self._state[POSE]), self._shown)
                self._jump[2] = wrapped(self._jump[2])
                self._jump_time = None

    def sample(self, time: float, odometry: np.ndarray) -> np.ndarray:
        """Take T_odom_base (3,) at `time` [s] and return T_map_odom (3,) to be shown now.

        Times that do not increase change nothing.
        """
        with self._lock:
            odometry = np.asarray(odometry, dtype=np.float64)
            if self._samples and time <= self._samples[-1][0]:
                time, odometry = self._samples[-1]
            else:
                self._follow(time, odometry)
                self._samples.append((time, odometry))
            if self._state is None:
                return self.start
            if self._jump_time is None:
                self._jump_time = time
            left = self._share_left(time - self._jump_time)
            self._shown = composed(self._state[POSE], left * self._jump) if left else self._state[POSE].copy()
            return _correction(self._shown, odometry)

    def standing_sample(self, time: float, odometry: np.ndarray) -> np.ndarray:
        """Return what `sample` does for an odometry without times, in which no error can go on after a belief."""
        with self._lock:
            if self._state is not None:
                self._state[RATE], self._fading = 0.0, None
            return self.sample(time, odometry)

    def _follow(self, time: float, odometry: np.ndarray) -> None:
        if self._state is None or not self._samples:
            return
        if time <= self._state_time:
            return
        before, pose = self._samples[-1]
        if before < self._state_time:
            # A belief that is newer than the newest sample: what the odometry did before it is part of it.
            track = Track(np.array([before, time]), np.array([pose, odometry]))
            before, pose = self._state_time, track.at(np.array(self._state_time))
        self._step(before, pose, time, odometry)

    def _bring_on(self, start: float, track: Track, times: np.ndarray) -> None:
        """Bring the state from `start` [s] to the newest of `times` (n,), n > 0."""
        if self._fading is None:
            self._state[POSE] = advanced_path(self._state, start, track, times)[-1]
            return
        nodes = np.append(start, times)
        poses = track.at(nodes)
        for number in range(len(times)):
            self._step(nodes[number], poses[number], nodes[number + 1], poses[number + 1])

    def _step(self, before: float, pose: np.ndarray, time: float, odometry: np.ndarray) -> None:
        """Bring the state from `before` to `time` [s], between which the odometry goes from `pose` to `odometry`."""
        if self._fading is None:
            self._state[POSE] = advanced(self._state, time - before, pose, odometry)
            return
        fading = self._fading.to_a_stop() if self._beliefs.overdue(time) else self._fading
        later = fading.after(self._state[RATE], time - before)
        self._state[RATE] = (self._state[RATE] + later) / 2.0
        self._state[POSE] = advanced(self._state, time - before, pose, odometry)
        self._state[RATE] = later

    def _share_left(self, seconds: float) -> float:
        if self.blend_time <= 0.0:
            return 0.0
        return min(max(1.0 - seconds / self.blend_time, 0.0), 1.0)


def _correction(T_map_base: np.ndarray, T_odom_base: np.ndarray) -> np.ndarray:
    """Return T_map_odom (3,), with its yaw in [-pi, pi); in plain numbers, which is faster for a single pose."""
    x, y, yaw = T_odom_base.tolist()
    turn = float(T_map_base[2]) - yaw
    cos, sin = math.cos(turn), math.sin(turn)
    return np.array([T_map_base[0] - cos * x + sin * y, T_map_base[1] - sin * x - cos * y, wrapped(turn)])
