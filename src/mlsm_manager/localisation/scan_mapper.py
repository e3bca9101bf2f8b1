"""The interface of what finds the poses of scans and draws the map, behind the localiser."""

from typing import List, Mapping, Optional, Protocol, Tuple

import numpy as np

from mlsm_manager.localisation.map_updates import CloudUpdate, ScanUpdate
from mlsm_manager.localisation.timed_points import TimedPoints
from mlsm_manager.matching.matchers.matcher_table import Matcher
from mlsm_manager.scan_matching.prediction import Belief, OdometryErrors
from mlsm_manager.scan_matching.result import MatchResult
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.self_check.verdict import Verdict
from mlsm_manager.surface_map.blocks import Blocks, BlockSource
from mlsm_manager.surface_map.files.map_file import Layer
from mlsm_manager.surface_map.running_copy import RunningCopy


class ScanMapper(Protocol):
    """Finds the poses of scans and draws the map. `Mapper` does it scan by scan, with a matcher.

    A solver over many scans can take its place: it may change the poses of earlier scans with each one that it takes,
    as long as `belief`, `blocks` and the places of clouds are what it knows at the time they are asked for.
    """

    matching: bool
    matcher: Matcher
    errors: OdometryErrors
    belief: Optional[Belief]
    correction: np.ndarray

    @property
    def lookahead(self) -> float:
        """Seconds of odometry after the end of a scan that its track should hold."""

    def mount(self, sonar_in_base: np.ndarray) -> None:
        """Learn where the sonar is in base_link, (2,) m."""

    def verdicts(self) -> List[Verdict]:
        """What the run says of itself, without any truth."""

    @property
    def blocks(self) -> Blocks:
        """The map that is shown and saved."""

    @property
    def block_count(self) -> int:
        """Number of those blocks, without a copy of them."""

    @property
    def target(self) -> BlockSource:
        """The map in which a lost vehicle is searched."""

    @property
    def layers(self) -> Mapping[Layer, Blocks]:
        """Copies of all maps, to be stored, each made when it is asked for."""

    def begin_copy(self, layer: Layer) -> RunningCopy:
        """Return a copy of a map as it is now, which is still to be made."""

    def region(self, low: np.ndarray, high: np.ndarray) -> Blocks:
        """Return the blocks of the map that is shown in a box; see MultiLevelSurfaceMap.in_box."""

    def changed_tiles(self) -> Tuple[np.ndarray, Blocks]:
        """Return the tiles (n, 2) of the map that is shown that changed since the last call, and their blocks."""

    @property
    def keyframes(self) -> Mapping[str, np.ndarray]:
        """What else must be stored to go on with scans whose poses may still change, as arrays by name."""

    def restore(self, layers: Mapping[Layer, Blocks], keyframes: Mapping[str, np.ndarray]) -> str:
        """Take stored maps in the place of the present ones; raises ValueError for other resolutions.

        Return why the stored run cannot go on; nothing where it does, or where there is none. keyframes: as stored,
        where the odometry is still the same; empty else.
        """

    def start_from(self, belief: Belief, correction: np.ndarray) -> None:
        """Expect the next scan where `correction` T_map_odom (3,) puts the odometry, as sure as `belief` says."""

    def take_echoes(self, scan: Scan) -> ScanUpdate:
        """Find the pose of a scan, and keep the scan where that holds."""

    def adopt(self, scan: Scan, result: MatchResult) -> ScanUpdate:
        """Take a match that was made elsewhere as the pose of a scan."""

    def take_cloud(self, cloud: TimedPoints) -> CloudUpdate:
        """Insert a cloud, or let it wait until the pose of its time is known."""

    def take_placed(self, points: np.ndarray) -> CloudUpdate:
        """Insert points (n, 4) that are in map already."""

    def take_waiting(self) -> Optional[CloudUpdate]:
        """Insert or carve the next cloud that waited; None when there is none for which that can be done now."""

    def follow(self, track: Track, time: float) -> None:
        """Bring the belief to a later `time` by the odometry alone."""

    def forget_place(self) -> None:
        """Keep the map, forget the pose."""

    def clear(self) -> None:
        """Forget map and pose."""
