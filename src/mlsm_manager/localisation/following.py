"""Follows the vehicle between scans: an odometry that goes on, the correction that is shown, the age of the fix."""

from dataclasses import replace
from typing import Callable, List, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.localisation.clouds import MapCloud
from mlsm_manager.localisation.live_correction import LiveCorrection
from mlsm_manager.localisation.place_now import FixAge, PlaceNow
from mlsm_manager.localisation.updates import ScanUpdate
from mlsm_manager.odometry.steps import ContinuousOdometry, MotionLimits, Step
from mlsm_manager.odometry.trembling import with_headings_smoothed
from mlsm_manager.scan_matching.prediction import Belief, OdometryErrors
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.scan_matching.scan_path import POSE
from mlsm_manager.self_check.causes import Cause
from mlsm_manager.self_check.live_causes import LiveCauses
from node_support.geometry import composed, inverse, transformed


class Following:
    """A correction can be asked for while a scan is being matched, by another thread."""

    def __init__(self, limits: MotionLimits, blend_time: float, clock: Callable[[], float]) -> None:
        """See Localiser."""
        self._live = LiveCorrection(blend_time)
        self._odometry = ContinuousOdometry(limits)
        self._age = FixAge()
        self._causes = LiveCauses()
        self._clock = clock
        self._came: Optional[Tuple[float, float]] = None

    def use(self, blend_time: float) -> None:
        """Go over to a new correction within `blend_time` [s] from now on."""
        self._live.blend_time = blend_time

    def mount(self, sonar_in_base: np.ndarray) -> None:
        """Learn where the sonar is in base_link, (2,) m."""
        self._causes.sonar_in_base = sonar_in_base

    def clear(self) -> None:
        """Forget everything, because time jumped or the map is gone."""
        for part in (self._live, self._odometry, self._age, self._causes):
            part.clear()
        self._came = None

    def start_from(self, correction: np.ndarray) -> None:
        """Show `correction` T_map_odom (3,) until the first belief."""
        self._live.start_from(correction)

    def taken(self, scan: Scan) -> Scan:
        """Learn a scan's odometry, and return the scan with one that goes on, and whose headings do not tremble."""
        odometry, (smooth, trembling) = self._odometry, with_headings_smoothed(scan.track)
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
        return replace(cloud, points=self._moved(cloud.points, cloud.times)) if self.steps else cloud

    def _moved(self, points: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return points (n, 4) [m] in odom, of `times` (n,) s, in the odometry that goes on."""
        return transformed(self._odometry.fixes(times), points) if len(points) else points

    def learned(self, scan: Scan, update: ScanUpdate, is_compared: bool) -> ScanUpdate:
        """Go on from what a scan that was `taken` told; return it as unsure as causes make it.

        is_compared: with other scans, for causes.
        """
        if update.belief is not None:
            self.believe(update.belief)
            self._age.learn_odometry(scan.reference_time, scan.reference_pose)
            if is_compared:
                self._causes.take(scan, update.belief.theta[POSE])
        if not update.accepted or update.result is None:
            return update
        self._age.learn_fix(scan.reference_time)
        return replace(update, result=update.result.widened(self._causes.covariance(self._wrong)))

    def believe(self, belief: Belief) -> None:
        """Take what a match found at a time in the past."""
        self._live.believe(belief)

    def followed(self, track: Track, time: float) -> Track:
        """Learn an odometry up to `time` [s], where a belief is brought to; return it as one that goes on."""
        self._odometry.take(track)
        followed = self._odometry.followed(track)
        self._age.learn_odometry(time, followed.at(np.array(time)))
        return followed

    def correction(self, time: float, odometry: np.ndarray) -> np.ndarray:
        """Return T_map_odom (3,) to be shown at `time` [s], when the odometry says T_odom_base (3,)."""
        self._odometry.take(Track(np.array([time]), odometry[np.newaxis]))
        fix = self._odometry.fixes(np.array(time))
        return composed(self._live.sample(time, composed(fix, odometry)), fix)

    def standing_correction(self, odometry: np.ndarray) -> np.ndarray:
        """Return T_map_odom (3,) to be shown now by an odometry without stamps, as a static transform is.

        Such an odometry says nothing of the time between scans: a new correction is blended in by the wall clock, and
        then holds.
        """
        if self._came is None:
            return self._live.start
        scan_time, came_at = self._came
        since = min(max(self._clock() - came_at, 0.0), self._live.blend_time)
        return self._live.standing_sample(scan_time + since, odometry)

    def place_at(
        self, time: float, odometry: np.ndarray, belief: Belief, errors: OdometryErrors
    ) -> Optional[PlaceNow]:  # fmt: skip
        """Return how old and how good the position is at `time` [s], when the odometry says T_odom_base (3,)."""
        pose = composed(self._odometry.fixes(np.array(time)), odometry)
        return self._age.place_at(time, pose, belief, errors, self._causes.covariance(self._wrong))

    @property
    def last_fix(self) -> np.ndarray:
        """T_continuous_odom (3,) of the newest odometry."""
        return self._odometry.fixes(np.array(np.inf))

    def goes_on_at(self, odometry: np.ndarray) -> bool:
        """Return whether T_odom_base (3,) is where the vehicle was just before."""
        return self._odometry.goes_on_at(odometry)

    def notice_standing(self, stood: Sequence[Tuple[float, float]]) -> None:
        """Learn from when to when [s] stamps of the odometry went on after its clock had stood; `stood` may grow."""
        self._odometry.stood = stood

    @property
    def steps(self) -> Sequence[Step]:
        """What the odometry did that no vehicle does, oldest first; it was left out."""
        return self._odometry.steps

    @property
    def _wrong(self) -> Sequence[Step]:
        return [*self._odometry.trembling, *self.steps]

    def look_for_causes(self) -> None:
        """Look for what is wrong where new scans may show it, which takes most of a second.

        Scans and corrections are taken meanwhile.
        """
        self._causes.look()

    def causes(self) -> List[Cause]:
        """Return what was found to be wrong, ranked."""
        return self._causes.causes(self._wrong)
