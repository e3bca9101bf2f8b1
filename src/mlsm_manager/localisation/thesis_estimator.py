"""The thesis's way (6.5.6): each scan is matched alone, with the map of the scans before, or rejected."""

from typing import Mapping

import numpy as np

from mlsm_manager.localisation.clouds import PATH_POINTS
from mlsm_manager.localisation.estimator import Estimator
from mlsm_manager.localisation.joint_session import belief_at, expected_at
from mlsm_manager.localisation.updates import CloudUpdate, ScanUpdate
from mlsm_manager.scan_matching.prediction import predicted, updated_by_heading
from mlsm_manager.scan_matching.scan import Belief, MapCloud, MatchResult, Scan, corrected_points
from mlsm_manager.scan_matching.scan_path import ERRORS, POSE
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.map_file import Layer
from node_support.geometry import composed, move_of

_FEWEST_BLOCKS = 15  # of a map that can be matched with: fewer do not fix three coordinates against chance


class ThesisEstimator(Estimator):
    """Keeps the map, what is known of the pose, and the errors of the odometry. Takes any matcher of single scans.

    A scan that is not matched, because `matching` is off or because there is no map yet, is placed by the odometry as
    corrected so far and inserted; its pose is then certain.
    """

    def restore(self, layers: Mapping[Layer, Blocks], keyframes: Mapping[str, np.ndarray]) -> str:
        self._take(layers)
        return ""

    def add_scan(self, scan: Scan) -> ScanUpdate:
        """Match a scan, or place it by the odometry, and insert it into the map that is matched with."""
        belief = self._belief_at(scan)
        if not self.matching or len(self.matched) < _FEWEST_BLOCKS:
            return self._place(scan, belief)
        result = self.matcher.match(scan, self.matched, belief)
        if result.accepted:
            return self.adopt(scan, result)
        self.belief = belief
        self._history.add(*self._path(scan, belief), scan.track, holds=False)
        return ScanUpdate(scan, result, False, belief)

    def adopt(self, scan: Scan, result: MatchResult) -> ScanUpdate:
        """Accept a match: insert the scan into the map, and take its pose over into the belief."""
        self.belief = result.belief
        self.correction = scan.correction_to(result.pose)
        self._history.add(result.beam_times, result.beam_poses, scan.track, holds=True)
        self._insert_matched(corrected_points(scan, result), scan.times)
        return ScanUpdate(scan, result, True, self.belief)

    @property
    def _known_until(self) -> float:
        return self._history.end

    def _add_matched(self, cloud: MapCloud) -> CloudUpdate:
        if cloud.end > self._known_until:
            return self._wait(cloud)
        points, times = self._history.placed(cloud)
        return self._show(points, times, len(cloud) - len(points))

    def _place(self, scan: Scan, belief: Belief) -> ScanUpdate:
        times, poses = self._path(scan, belief)
        self._history.add(times, poses, scan.track, holds=True)
        self._insert_matched(*self._history.placed(MapCloud.of_scan(scan)))
        self.belief = Belief(belief.time, belief.theta, self.errors.covariance())
        # Where no error is known nothing is corrected: not even by rounding, so that clouds stay as they came.
        if belief.theta[ERRORS].any():
            self.correction = move_of(scan.reference_pose, belief.theta[POSE])
        return ScanUpdate(scan, None, True, self.belief)

    def _belief_at(self, scan: Scan) -> Belief:
        """Return what is known at the scan's reference time before it is matched."""
        if self.belief is None:
            if self._expected is None:
                self.belief = belief_at(scan.reference_time, scan.reference_pose, self.errors)
            else:
                self.belief = expected_at(self.correction, scan, self._expected)
        if scan.reference_time <= self.belief.time:
            return self.belief
        belief = predicted(self.belief, scan.track, scan.reference_time, self.errors)
        return updated_by_heading(belief, scan.reference_pose[2], self.errors.heading_deviation)

    def _path(self, scan: Scan, belief: Belief) -> tuple:
        """Return times (b,) and T_map_base (b, 3) of a scan that ends at the belief's time, by the odometry."""
        times = np.unique(np.append(np.linspace(scan.start, scan.reference_time, PATH_POINTS), scan.reference_time))
        correction = move_of(scan.reference_pose, belief.theta[POSE])
        return times, composed(correction, scan.track.at(times))
