"""Matches scan by scan with the map of the scans before, and keeps that map and the pose in it (thesis 6.5.6)."""

from collections import deque
from typing import Deque, List, Mapping, Optional, Sequence

import numpy as np

from mlsm_manager.localisation.correction_history import CorrectionHistory
from mlsm_manager.localisation.map_layers import MapSettings, ShowsMaps
from mlsm_manager.localisation.map_updates import MOST_WAITING, NOTHING_INSERTED, CloudUpdate, ScanUpdate
from mlsm_manager.localisation.timed_points import TimedPoints
from mlsm_manager.localisation.uncarved_clouds import UncarvedClouds
from mlsm_manager.matching.matchers.matcher_table import Matcher
from mlsm_manager.scan_matching.prediction import Belief, OdometryErrors, predicted, prior_of, updated_by_heading
from mlsm_manager.scan_matching.result import MatchResult, corrected_points
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.scan_matching.scan_path import ERRORS
from mlsm_manager.self_check.verdict import Verdict
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.files.map_file import Layer
from mlsm_manager.surface_map.free_space.beam_paths import FirstEchoes
from mlsm_manager.surface_map.free_space.carving import CarveReport
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry import composed, transformed


class Mapper(ShowsMaps):
    """Keeps the map, what is known of the pose, and the errors of the odometry.

    Scans of echoes are matched and inserted into the map that is matched with; clouds are inserted into the map that is
    shown. A scan that is not matched, because `matching` is off or because there is no map yet, is placed by the
    odometry as corrected so far and inserted; its pose is then certain.
    """

    def __init__(
        self, settings: MapSettings, errors: OdometryErrors, matcher: Matcher,
        sonar_in_base: Sequence[float] = (0.0, 0.0),
    ) -> None:  # fmt: skip
        """`sonar_in_base`: (2,) m; `mount` changes it."""
        self._sonar_in_base = np.array(sonar_in_base, dtype=np.float64)
        self.settings = settings
        self.errors = errors
        self.matcher = matcher
        self.matching = False
        self.clear()

    def clear(self) -> None:
        """Delete the map, and forget the pose in it."""
        settings = self.settings
        self.shown = MultiLevelSurfaceMap(
            settings.resolution, settings.limit, settings.expected_blocks, settings.kernel
        )
        self.free = MultiLevelSurfaceMap(settings.resolution, settings.limit)
        self.matched = MultiLevelSurfaceMap(settings.match_resolution, settings.limit)
        self.forget_place()

    @property
    def _shown_map(self) -> MultiLevelSurfaceMap:
        return self.shown

    @property
    def _matched_map(self) -> MultiLevelSurfaceMap:
        return self.matched

    @property
    def _free_space(self) -> MultiLevelSurfaceMap:
        return self.free

    @property
    def keyframes(self) -> Mapping[str, np.ndarray]:
        """None: a pose never changes once its scan is in the map."""
        return {}

    def restore(self, layers: Mapping[Layer, Blocks], keyframes: Mapping[str, np.ndarray]) -> str:
        """Take stored maps in the place of the present ones, and forget the place; there is no run to go on with.

        A map without a matched layer is matched with as it is shown. Raises ValueError, and keeps all as it is, for
        other resolutions than those of the settings.
        """
        shown = layers.get(Layer.SHOWN, layers.get(Layer.MATCHED))
        restored = Mapper(self.settings, self.errors, self.matcher, self._sonar_in_base)
        restored.shown.insert_blocks(shown)
        restored.matched.insert_blocks(layers.get(Layer.MATCHED, shown))
        if Layer.FREE in layers:
            restored.free.insert_blocks(layers[Layer.FREE])
        self.shown, self.matched, self.free = restored.shown, restored.matched, restored.free
        self.forget_place()
        return ""

    def start_from(self, belief: Belief, correction: np.ndarray) -> None:
        """Expect the next scan where `correction` T_map_odom (3,) puts the odometry, as sure as `belief` says."""
        self._start = belief
        self.correction = np.array(correction, dtype=np.float64)

    def forget_place(self) -> None:
        """Keep the map but forget the pose, because time jumped."""
        self.belief: Optional[Belief] = None
        self._start: Optional[Belief] = None
        self.correction = np.zeros(3)
        self._history = CorrectionHistory()
        self._waiting: Deque[TimedPoints] = deque(maxlen=MOST_WAITING)
        self._uncarved = UncarvedClouds()

    @property
    def lookahead(self) -> float:
        """A scan is matched as soon as it has ended."""
        return 0.0

    def mount(self, sonar_in_base: np.ndarray) -> None:
        """Learn where the sonar is in base_link, (2,) m, from where free space is seen."""
        self._sonar_in_base = sonar_in_base

    def verdicts(self) -> List[Verdict]:
        """Each match is judged alone: its status says it."""
        return []

    def take_echoes(self, scan: Scan) -> ScanUpdate:
        """Match a scan, or place it by the odometry, and insert it into the map that is matched with."""
        belief = self._belief_at(scan)
        if not self.matching or len(self.matched) < self.settings.fewest_blocks:
            return self._place(scan, belief)
        result = self.matcher.match(scan, self.matched, prior_of(belief, scan.reference_pose))
        return self.adopt(scan, result) if result.accepted else self._reject(scan, result, belief)

    def adopt(self, scan: Scan, result: MatchResult) -> ScanUpdate:
        """Accept a match: insert the scan into the map, and take its pose over into the belief."""
        theta = np.concatenate([result.pose, result.rate, result.motion])
        self.belief = Belief(scan.reference_time, theta, result.state_covariance)
        self.correction = result.correction(scan)
        self._history.add(result.beam_times, result.beam_poses, scan.track, holds=True)
        self._note(corrected_points(scan, result), scan.times)
        return ScanUpdate(scan, result, True, self.belief)

    def take_cloud(self, cloud: TimedPoints) -> CloudUpdate:
        """Insert a cloud into the map that is shown, or let it wait for the match of its time."""
        if not self.matching:
            return self._show(transformed(self.correction, cloud.points), cloud.times, 0)
        if cloud.end > self._history.end:
            self._waiting.append(cloud)
            return CloudUpdate(NOTHING_INSERTED, True, 0)
        placed = self._history.placed(cloud)
        return self._show(placed.points, placed.times, placed.unplaced)

    def take_placed(self, points: np.ndarray) -> CloudUpdate:
        """Insert points (n, 4) that are in map already into the map that is shown."""
        return CloudUpdate(self.shown.insert(points), False, 0)

    def take_waiting(self) -> Optional[CloudUpdate]:
        """Insert or carve the next cloud that waited, if its time is known now; None when there is none."""
        if self._waiting and not (self.matching and self._waiting[0].end > self._history.end):
            return self.take_cloud(self._waiting.popleft())
        if self.matching:
            # Corrections that scans are matched with are not those that such a cloud was placed with.
            self._uncarved.clear()
        return self._uncarved.carve_next(self._history, self._sonar_in_base, self._carve)

    def follow(self, track: Track, time: float) -> None:
        """Predict the belief at a later `time` by the odometry, after a long time without scans."""
        if self.belief is not None and time > self.belief.time:
            self.belief = predicted(self.belief, track, time, self.errors)

    def _show(self, points: np.ndarray, times: np.ndarray, unplaced: int) -> CloudUpdate:
        """Insert points (n, 4) in map, of beams taken at `times` (n,), into the map that is shown, and carve them."""
        report, origins = self.shown.insert(points), self._origins(times)
        if origins is None:
            self._uncarved.append(points, times)
            return CloudUpdate(report, False, unplaced)
        return CloudUpdate(report, False, unplaced, self._carve(points, times, origins))

    def _carve(self, points: np.ndarray, times: np.ndarray, origins: np.ndarray) -> Optional[CarveReport]:
        if self.settings.carver is None:
            return None
        beams = FirstEchoes.of_level(points, times, origins)
        return self.settings.carver.carve(self.shown, self.free, beams, points)

    def _origins(self, times: np.ndarray) -> Optional[np.ndarray]:
        return self._history.origins(times, self._sonar_in_base)

    def _note(self, points: np.ndarray, times: np.ndarray) -> None:
        """Insert points (n, 4) in map, of beams taken at `times` (n,), into the map that is matched with; clear it."""
        self.matched.insert(points)
        origins = self._origins(times)
        if self.settings.carver is not None and origins is not None:
            self.settings.carver.clear(self.matched, FirstEchoes.of_level(points, times, origins), points)

    def _place(self, scan: Scan, belief: Belief) -> ScanUpdate:
        times, poses = self._path(scan, belief)
        self._history.add(times, poses, scan.track, holds=True)
        placed = self._history.placed(TimedPoints.of_scan(scan))
        self._note(placed.points, placed.times)
        self.belief = Belief(belief.time, belief.theta, self.errors.covariance())
        # Where no error is known nothing is corrected: not even by rounding, so that clouds stay as they came.
        if belief.theta[ERRORS].any():
            self.correction = prior_of(belief, scan.reference_pose).correction
        return ScanUpdate(scan, None, True, self.belief)

    def _reject(self, scan: Scan, result: MatchResult, belief: Belief) -> ScanUpdate:
        self.belief = belief
        self._history.add(*self._path(scan, belief), scan.track, holds=False)
        return ScanUpdate(scan, result, False, belief)

    def _belief_at(self, scan: Scan) -> Belief:
        """Return what is known at the scan's reference time before it is matched."""
        if self.belief is None:
            self.belief = self._first_belief(scan)
        if scan.reference_time <= self.belief.time:
            return self.belief
        belief = predicted(self.belief, scan.track, scan.reference_time, self.errors)
        return updated_by_heading(belief, scan.reference_pose[2], self.errors.heading_deviation)

    def _first_belief(self, scan: Scan) -> Belief:
        if self._start is None:
            theta = np.concatenate([scan.reference_pose, np.zeros(5)])
            return Belief(scan.reference_time, theta, self.errors.covariance())
        theta = np.concatenate([composed(self.correction, scan.reference_pose), self._start.theta[3:]])
        return Belief(scan.reference_time, theta, self._start.covariance)

    def _path(self, scan: Scan, belief: Belief) -> tuple:
        """Return times (b,) and T_map_base (b, 3) of a scan that ends at the belief's time, by the odometry."""
        times = np.unique(np.append(np.linspace(scan.start, scan.reference_time, 17), scan.reference_time))
        correction = prior_of(belief, scan.reference_pose).correction
        return times, composed(correction, scan.track.at(times))
