"""Follows the vehicle between scans: an odometry that goes on, the correction that is shown, the age of the fix."""

from dataclasses import replace
from typing import Callable, List, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.localisation.clouds import MapCloud
from mlsm_manager.localisation.live_correction import LiveCorrection
from mlsm_manager.localisation.place_now import FixAge, PlaceNow
from mlsm_manager.localisation.resumption import StoredPlace
from mlsm_manager.localisation.updates import ScanUpdate
from mlsm_manager.odometry.steps import ContinuousOdometry, MotionLimits, Step
from mlsm_manager.odometry.trembling import with_trembling_smoothed
from mlsm_manager.scan_matching.prediction import Belief, OdometryErrors
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.scan_matching.scan_path import POSE
from mlsm_manager.self_check.causes import Cause
from mlsm_manager.self_check.live_causes import LiveCauses
from node_support.geometry import composed, inverse, transformed


class Following:
    """A correction can be asked for while a scan is being matched, by another thread.

    live: what is shown. odometry: what it did that no vehicle does is left out. found: what the newest scans show.
    resumed_at: the stored place from which the vehicle goes on; None where it does not.
    """

    def __init__(self, limits: MotionLimits, blend_time: float, clock: Callable[[], float]) -> None:
        """See Localiser."""
        self.live = LiveCorrection(blend_time)
        self.odometry = ContinuousOdometry(limits)
        self._age = FixAge()
        self.found = LiveCauses()
        self._clock = clock
        self._came: Optional[Tuple[float, float]] = None
        self.resumed_at: Optional[StoredPlace] = None

    def clear(self) -> None:
        """Forget everything, because time jumped or the map is gone."""
        for part in (self.live, self.odometry, self._age, self.found):
            part.clear()
        self._came = self.resumed_at = None

    def bridged(self, track: Track) -> Track:
        """Return a track that begins where the vehicle was when its place was stored; see StoredPlace.bridged."""
        return track if self.resumed_at is None else self.resumed_at.bridged(track)

    def taken(self, scan: Scan) -> Scan:
        """Learn a scan's odometry, and return the scan with one that goes on, which does not tremble."""
        odometry, (smooth, trembling) = self.odometry, with_trembling_smoothed(scan.track)
        self._came = scan.reference_time, self._clock()
        if trembling:
            odometry.trembling = odometry.trembling or trembling
            moves = composed(smooth.at(scan.times), inverse(scan.track.at(scan.times)))
            scan = replace(scan, points=transformed(moves, scan.points), track=smooth)
        odometry.take(scan.track)
        if not odometry.steps:
            return scan
        return replace(scan, points=self._moved(scan.points, scan.times), track=odometry.followed(scan.track))

    def cloud(self, cloud: MapCloud) -> MapCloud:
        """Return a cloud of which the odometry is known where an odometry that goes on puts it."""
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
            self._age.learn_odometry(scan.reference_time, scan.reference_pose)
            if is_compared:
                self.found.take(scan, update.belief.theta[POSE])
        if not update.accepted or update.result is None:
            return update
        self._age.learn_fix(scan.reference_time)
        return replace(update, result=update.result.widened(self.found.covariance(self._wrong)))

    def followed(self, track: Track, time: float) -> Track:
        """Learn an odometry up to `time` [s], where a belief is brought to; return it as one that goes on."""
        self.odometry.take(track)
        followed = self.odometry.followed(track)
        self._age.learn_odometry(time, followed.at(np.array(time)))
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
        """Return how old and how good the position is at `time` [s], when the odometry says T_odom_base (3,)."""
        pose = composed(self.odometry.fixes(np.array(time)), odometry)
        return self._age.place_at(time, pose, belief, errors, self.found.covariance(self._wrong))

    @property
    def last_fix(self) -> np.ndarray:
        """T_continuous_odom (3,) of the newest odometry."""
        return self.odometry.fixes(np.array(np.inf))

    @property
    def _wrong(self) -> Sequence[Step]:
        return [*self.odometry.trembling, *self.odometry.steps]

    def causes(self) -> List[Cause]:
        """Return what was found to be wrong, ranked."""
        return self.found.causes(self._wrong)
