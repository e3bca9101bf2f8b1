"""Follows the vehicle between scans: an odometry that goes on, the correction that is shown, the age of the fix."""

import math
import threading
from collections import deque
from dataclasses import replace
from typing import Callable, Deque, List, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.localisation.place_now import PlaceNow
from mlsm_manager.localisation.resumption import StoredPlace
from mlsm_manager.localisation.updates import ScanUpdate
from mlsm_manager.odometry.continuous import ContinuousOdometry, with_trembling_smoothed
from mlsm_manager.odometry.steps import MotionLimits, Step
from mlsm_manager.scan_matching.prediction import OdometryErrors, advanced, advanced_path, carried_on
from mlsm_manager.scan_matching.scan import Belief, Fading, MapCloud, Scan, Track
from mlsm_manager.scan_matching.scan_path import POSE, POSITION, RATE
from mlsm_manager.self_check.causes import Cause
from mlsm_manager.self_check.live_causes import LiveCauses
from node_support.geometry import composed, move_of, seen_from, transformed, wrapped
from node_support.timing import UsualInterval

_MOST_SAMPLES = 4000  # of the odometry: a minute at 60 per second, longer than a scan and its match take
_IDENTITY = np.zeros(3)


class LiveCorrection:
    """The correction map -> odom between scans, without jumps: the odometry's errors that were found go on.

    A new belief is approached within `blend_time` seconds. Where it says how its rates fade, the vehicle is shown to
    come to rest once the next belief is overdue.

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
                self._jump = seen_from(self._state[POSE], self._shown)
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
            left = 0.0
            if self.blend_time > 0.0:
                left = min(max(1.0 - (time - self._jump_time) / self.blend_time, 0.0), 1.0)
            self._shown = composed(self._state[POSE], left * self._jump) if left else self._state[POSE].copy()
            return _correction(self._shown, odometry)

    def standing_sample(self, time: float, odometry: np.ndarray) -> np.ndarray:
        """Return what `sample` does for an odometry without times, in which no error can go on after a belief."""
        with self._lock:
            if self._state is not None:
                self._state[RATE], self._fading = 0.0, None
            return self.sample(time, odometry)

    def _follow(self, time: float, odometry: np.ndarray) -> None:
        if self._state is None or not self._samples or time <= self._state_time:
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


def _correction(T_map_base: np.ndarray, T_odom_base: np.ndarray) -> np.ndarray:
    """Return T_map_odom (3,), with its yaw in [-pi, pi); in plain numbers, which is faster for a single pose."""
    x, y, yaw = T_odom_base.tolist()
    turn = float(T_map_base[2]) - yaw
    cos, sin = math.cos(turn), math.sin(turn)
    return np.array([T_map_base[0] - cos * x + sin * y, T_map_base[1] - sin * x - cos * y, wrapped(turn)])


class Following:
    """A correction can be asked for while a scan is being matched, by another thread.

    live: what is shown. odometry: what it did that no vehicle does is left out. found: what the newest scans show.
    resumed_at: the stored place from which the vehicle goes on; None where it does not.
    """

    def __init__(self, limits: MotionLimits, blend_time: float, clock: Callable[[], float]) -> None:
        self.live = LiveCorrection(blend_time)
        self.odometry = ContinuousOdometry(limits)
        self.found = LiveCauses()
        self._clock = clock
        self.clear()

    def clear(self) -> None:
        """Forget everything, because time jumped or the map is gone."""
        for part in (self.live, self.odometry, self.found):
            part.clear()
        self._came: Optional[Tuple[float, float]] = None
        self.resumed_at: Optional[StoredPlace] = None
        self._intervals, self._fixes = UsualInterval(), 0
        self._fixed_at: Optional[float] = None
        self._believed: Optional[Tuple[float, np.ndarray]] = None

    def bridged(self, track: Track) -> Track:
        """Return a track that begins where the vehicle was when its place was stored; see StoredPlace.bridged."""
        return track if self.resumed_at is None else self.resumed_at.bridged(track)

    def taken(self, scan: Scan) -> Scan:
        """Learn a scan's odometry, and return the scan with one that goes on, which does not tremble.

        Echoes of a head that stood untold are left out: they lie on an arc that nothing in the water has.
        """
        odometry, (smooth, trembling) = self.odometry, with_trembling_smoothed(scan.track)
        self._came = scan.reference_time, self._clock()
        if trembling:
            odometry.trembling = odometry.trembling or trembling
            moves = move_of(scan.track.at(scan.times), smooth.at(scan.times))
            scan = replace(scan, points=transformed(moves, scan.points), track=smooth)
        odometry.take(scan.track)
        scan = scan.chosen(self.found.turned_as_told(scan.times))
        if not odometry.steps:
            return scan
        return replace(scan, points=self._moved(scan.points, scan.times), track=odometry.followed(scan.track))

    def cloud(self, cloud: MapCloud) -> MapCloud:
        """Return a cloud of which the odometry is known where an odometry that goes on puts it; see `taken`."""
        cloud = cloud.chosen(self.found.turned_as_told(cloud.times))
        return replace(cloud, points=self._moved(cloud.points, cloud.times)) if self.odometry.steps else cloud

    def _moved(self, points: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return points (n, 4) [m] in odom, of `times` (n,) s, in the odometry that goes on."""
        return transformed(self.odometry.fixes(times), points) if len(points) else points

    def learned(self, scan: Scan, update: ScanUpdate, is_compared: bool) -> ScanUpdate:
        """Go on from what a scan that was `taken` told; return it as unsure as causes make it.

        is_compared: with other scans, for causes.
        """
        if update.belief is not None:
            self.live.believe(update.belief)
            self._believed = scan.reference_time, scan.reference_pose
            if is_compared:
                self.found.take(scan, update.belief.theta[POSE])
        if not update.accepted or update.result is None:
            return update
        self._fixed_at = scan.reference_time
        self._intervals.take(self._fixed_at)
        self._fixes += 1
        return replace(update, result=update.result.widened(self.found.covariance(self._wrong)))

    def followed(self, track: Track, time: float) -> Track:
        """Learn an odometry up to `time` [s], where a belief is brought to; return it as one that goes on."""
        self.odometry.take(track)
        followed = self.odometry.followed(track)
        self._believed = time, followed.at(np.array(time))
        return followed

    def correction(self, time: float, odometry: np.ndarray) -> np.ndarray:
        """Return T_map_odom (3,) to be shown at `time` [s], when the odometry says T_odom_base (3,)."""
        self.odometry.take(Track(np.array([time]), odometry[np.newaxis]))
        fix = self.odometry.fixes(np.array(time))
        return composed(self.live.sample(time, composed(fix, odometry)), fix)

    def standing_correction(self, odometry: np.ndarray) -> np.ndarray:
        """Return T_map_odom (3,) to be shown now by an odometry without stamps, as a static transform is.

        Such an odometry says nothing of the time between scans: a new correction is blended in by the wall clock, and
        then holds.
        """
        if self._came is None:
            return self.live.start
        scan_time, came_at = self._came
        since = min(max(self._clock() - came_at, 0.0), self.live.blend_time)
        return self.live.standing_sample(scan_time + since, odometry)

    def place_at(self, time: float, odometry: np.ndarray, belief: Belief, errors: OdometryErrors) -> Optional[PlaceNow]:
        """Return how old and how good the position is at `time` [s], when the odometry says T_odom_base (3,).

        None before the first fix.
        """
        if self._fixed_at is None or self._believed is None:
            return None
        if time > belief.time and self._believed[0] == belief.time:
            pose = composed(self.odometry.fixes(np.array(time)), odometry)
            belief = carried_on(belief, self._believed[1], pose, time, errors)
        covariance = belief.covariance[POSE, POSE].copy()
        covariance[POSITION, POSITION] += self.found.covariance(self._wrong)
        overdue = self._intervals.overdue(time)
        return PlaceNow(time, time - self._fixed_at, overdue, covariance, self._fixes, self.found.by_mounts)

    @property
    def _wrong(self) -> Sequence[Step]:
        return [*self.odometry.trembling, *self.odometry.steps]

    def causes(self) -> List[Cause]:
        """Return what was found to be wrong, ranked."""
        return self.found.causes(self._wrong)
