"""The base of what finds the poses of scans and draws the map, behind the localiser."""

from abc import ABC, abstractmethod
from collections import deque
from typing import Deque, Dict, Mapping, Optional, Sequence, Tuple, Union

import numpy as np

from mlsm_manager.localisation.clouds import CorrectionHistory
from mlsm_manager.localisation.joint_session import JointSession
from mlsm_manager.localisation.keyframe_map import KeyframeMaps, MapSettings
from mlsm_manager.localisation.keyframe_traces import KeyframeCarving
from mlsm_manager.localisation.updates import NOTHING_INSERTED, CloudUpdate, ScanUpdate
from mlsm_manager.scan_matching.prediction import OdometryErrors, predicted
from mlsm_manager.scan_matching.scan import Belief, MapCloud, Matcher, MatchResult, Scan, Track
from mlsm_manager.surface_map.blocks import Blocks, BlockSource
from mlsm_manager.surface_map.map_file import Layer
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry import transformed

_MOST_WAITING = 8  # clouds that wait for their scans: with one per scan, more than a matcher is ever behind


class Estimator(ABC):
    """Finds the poses of scans and draws the map: `Joint` with a solver over many scans, or the thesis's way.

    Scans are inserted into the map that is matched with, clouds into the map that is shown. While `matching` is off
    both are placed by the odometry as corrected so far. An estimator may change the poses of earlier scans with each
    one that is added: `belief`, the maps and the places of clouds are what it knows at the time they are asked for.

    sonar_in_base: (2,) m, from where free space is seen; of the joint solver from the next run on. lookahead: s of
    odometry after the end of a scan that its track should hold. session: the current run of the joint solver; None
    where none runs. odometry: what was found out about it, as text for people; empty where nothing had to be.
    """

    lookahead = 0.0
    session: Optional[JointSession] = None
    odometry = ""
    _bends = False
    """Whether what is settled in the maps may move with the path."""

    def __init__(
        self,
        settings: MapSettings,
        errors: OdometryErrors,
        matcher: Matcher,
        sonar_in_base: Sequence[float] = (0.0, 0.0),
    ) -> None:
        self.settings = settings
        self.errors = errors
        self.matcher = matcher
        self.matching = False
        self.sonar_in_base = np.array(sonar_in_base, dtype=np.float64)
        self.clear()

    def clear(self) -> None:
        """Delete the map, and forget the pose in it."""
        self._maps = KeyframeMaps.empty(self.settings, self._bends)
        self.forget_place()

    def _take(self, layers: Mapping[Layer, Blocks]) -> None:
        """Have stored maps in the place of the present ones, and forget the pose; see `restore`."""
        maps = KeyframeMaps.of_layers(self.settings, layers, self._bends)
        self.forget_place()
        self._maps = maps

    def forget_place(self) -> None:
        """Keep the map but forget the pose, because time jumped."""
        self.belief: Optional[Belief] = None
        self.correction = np.zeros(3)
        self._expected: Optional[Belief] = None
        self._history = CorrectionHistory()
        self._waiting: Deque[MapCloud] = deque(maxlen=_MOST_WAITING)
        self._uncarved: Deque[Tuple[np.ndarray, np.ndarray]] = deque(maxlen=_MOST_WAITING)

    def start_from(self, belief: Belief, correction: np.ndarray) -> None:
        """Expect the next scan where `correction` T_map_odom (3,) puts the odometry, as sure as `belief` says.

        In an empty map, in which nothing can be found, the run begins there.
        """
        self._expected = belief if len(self.matched) else None
        self.correction = np.array(correction, dtype=np.float64)

    @property
    def shown(self) -> MultiLevelSurfaceMap:
        return self._maps.shown.map

    @property
    def matched(self) -> MultiLevelSurfaceMap:
        """The map that scans are matched with, that is searched for a lost vehicle, and among which a run begins."""
        return self._maps.matched.map

    @property
    def target(self) -> BlockSource:
        """The map in which a lost vehicle is searched."""
        return self.matched

    def map_of(self, layer: Layer) -> Union[MultiLevelSurfaceMap, KeyframeCarving]:
        return {Layer.SHOWN: self.shown, Layer.MATCHED: self.matched, Layer.FREE: self._maps.shown.free}[layer]

    @property
    def layers(self) -> Dict[Layer, Blocks]:
        """Copies of all maps that are stored."""
        return {layer: self.map_of(layer).blocks for layer in Layer}

    @property
    def keyframes(self) -> Mapping[str, np.ndarray]:
        """What else must be stored to go on with scans whose poses may still change, as arrays by name."""
        return {}

    @abstractmethod
    def restore(self, layers: Mapping[Layer, Blocks], keyframes: Mapping[str, np.ndarray]) -> str:
        """Take stored maps in the place of the present ones, and forget the place, or go on with stored `keyframes`.

        Return why the stored run cannot go on; nothing where it does, or where there is none. keyframes: as stored,
        where the odometry is still the same; empty else. A map without a matched layer is matched with as it is shown.
        Raises ValueError, and keeps all as it is, for other resolutions than those of the settings.
        """

    @abstractmethod
    def add_scan(self, scan: Scan) -> ScanUpdate:
        """Find the pose of a scan of echoes, or place it by the odometry, and keep the scan where that holds."""

    @abstractmethod
    def adopt(self, scan: Scan, result: MatchResult) -> ScanUpdate:
        """Take a match that was made elsewhere as the pose of a scan."""

    def follow(self, track: Track, time: float) -> None:
        """Bring the belief to a later `time` [s] by the odometry alone, after a long time without scans."""
        if self.belief is not None and time > self.belief.time:
            self.belief = predicted(self.belief, track, time, self.errors)

    def add_points(self, points: np.ndarray) -> CloudUpdate:
        """Insert points (n, 4) that are in map already into the map that is shown."""
        return CloudUpdate(self._maps.shown.insert(points), False, 0)

    def add_cloud(self, cloud: MapCloud) -> CloudUpdate:
        """Insert a cloud into the map that is shown, or let it wait until the pose of its time is known."""
        if self.matching:
            return self._add_matched(cloud)
        return self._show(transformed(self.correction, cloud.points), cloud.times, 0)

    def add_waiting(self) -> Optional[CloudUpdate]:
        """Insert or carve the next cloud that waited, if its time is known now; None when there is none."""
        if self._waiting and not (self.matching and self._waiting[0].end > self._known_until):
            return self.add_cloud(self._waiting.popleft())
        if self.matching:
            # Corrections that scans are matched with are not those that such a cloud was placed with.
            self._uncarved.clear()
        while self._uncarved and self._history.reaches(self._uncarved[0][1]):
            points, times = self._uncarved.popleft()
            origins = self._history.origins(times, self.sonar_in_base)
            if origins is not None:
                return CloudUpdate(NOTHING_INSERTED, False, 0, self._maps.shown.carve(points, times, origins))
        return None

    @property
    @abstractmethod
    def _known_until(self) -> float:
        """Time [s] until which the poses of matched scans are known; -inf before the first."""

    @abstractmethod
    def _add_matched(self, cloud: MapCloud) -> CloudUpdate:
        """Insert a cloud where matched scans put it, or let it wait."""

    def _wait(self, cloud: MapCloud) -> CloudUpdate:
        self._waiting.append(cloud)
        return CloudUpdate(NOTHING_INSERTED, True, 0)

    def _show(self, points: np.ndarray, times: np.ndarray, unplaced: int) -> CloudUpdate:
        """Insert points (n, 4) in map, of beams taken at `times` (n,), and carve once it is known from where."""
        report, origins = self._maps.shown.insert(points), self._history.origins(times, self.sonar_in_base)
        if origins is not None:
            return CloudUpdate(report, False, unplaced, self._maps.shown.carve(points, times, origins))
        if len(points):
            self._uncarved.append((points, times))
        return CloudUpdate(report, False, unplaced)

    def _insert_matched(self, points: np.ndarray, times: np.ndarray) -> None:
        """Insert points (n, 4) in map, of beams taken at `times` (n,), into the map that is matched with; carve it."""
        self._maps.matched.insert(points)
        origins = self._history.origins(times, self.sonar_in_base)
        if origins is not None:
            self._maps.matched.carve(points, times, origins)
