"""A map drawn from keyframes: clouds whose places may still change are kept as points and drawn anew when they do."""

from collections import deque
from dataclasses import dataclass
from typing import Deque, List, Optional

import numpy as np

from mlsm_manager.localisation.keyframe_carving import MOST_FOLLOWED, KeyframeCarving
from mlsm_manager.localisation.placement import Placement
from mlsm_manager.localisation.timed_points import TimedPoints
from mlsm_manager.surface_map.free_space.carving import Carver, CarveReport
from mlsm_manager.surface_map.insertion import InsertionKernel
from mlsm_manager.surface_map.mlsm import InsertReport, MultiLevelSurfaceMap
from mlsm_manager.surface_map.overlay import Covered, Overlay


@dataclass(frozen=True)
class Drawn:
    """report: of the newest cloud. carved: what clouds that are settled now carved; None where nothing was."""

    report: InsertReport
    carved: Optional[CarveReport]


class KeyframeMap:
    """What is settled stays in the map; above it lies what the newest keyframes add, which can be taken off again.

    The cost of drawing depends on the keyframes that are not settled, not on the map.
    """

    def __init__(
        self,
        resolution: float,
        limit: float,
        expected_blocks: int = 0,
        kernel: InsertionKernel = InsertionKernel.NUMPY,
        carver: Optional[Carver] = None,
        most_followed: int = MOST_FOLLOWED,
    ) -> None:
        """`carver`: what marks free space and takes blocks away, None for nothing. most_followed: see KeyframeCarving.

        The rest as MultiLevelSurfaceMap.
        """
        self.map = MultiLevelSurfaceMap(resolution, limit, expected_blocks, kernel)
        self.free = KeyframeCarving(resolution, limit, carver, most_followed)
        self._moving: Deque[TimedPoints] = deque()
        self._overlay = Overlay(self.map)
        self._above = self._new().blocks

    def _new(self) -> MultiLevelSurfaceMap:
        return MultiLevelSurfaceMap(self.map.resolution, self.map.limit)

    @property
    def moving(self) -> List[TimedPoints]:
        """The keyframes that may still move, oldest first."""
        return list(self._moving)

    @property
    def covered(self) -> Covered:
        """What the map holds without them, in the cells that they changed."""
        return self._overlay.covered

    def insert(self, points: np.ndarray) -> InsertReport:
        """Insert points (n, 4) in map whose places will not change."""
        return self.insert_cloud(points, np.empty(0), None).report

    def insert_cloud(self, points: np.ndarray, times: np.ndarray, origins: Optional[np.ndarray]) -> Drawn:
        """Insert points (n, 4) in map whose places will not change, of beams taken at `times` (n,) s.

        origins: (n, 2) m, where they were heard from; None where that is not known, and nothing is carved.
        """
        self._overlay.take_off()
        report = self.map.insert(points)
        carved = None if origins is None else self.free.carve(self.map, points, times, origins)
        self._overlay.lay(self._above)
        return Drawn(report, carved)

    def add(self, cloud: TimedPoints) -> None:
        """Add a keyframe; it is in the map from the next `draw` on."""
        self._moving.append(cloud)

    def draw(self, placement: Placement, settled_until: float) -> Drawn:
        """Draw all keyframes where they are now; those that end by `settled_until` [s] stay as they are drawn."""
        self._overlay.take_off()
        drawn = Drawn(InsertReport(0, 0, 0), None)
        while self._moving and self._moving[0].end <= settled_until:
            drawn = self._settled(self._moving.popleft(), placement, drawn.carved)
        if not self._moving:
            self._above = self._new().blocks
            return drawn
        return Drawn(self._draw_moving(placement), drawn.carved)

    def settle(self, placement: Placement) -> None:
        """Draw all keyframes for the last time."""
        if self._moving:
            self.draw(placement, np.inf)

    def _settled(self, cloud: TimedPoints, placement: Placement, before: Optional[CarveReport]) -> Drawn:
        """Draw the oldest keyframe for ever; `before`: what older ones carved."""
        self.free.forget_oldest()
        points = placement.points(cloud)
        report = self.map.insert(points)
        carved = self.free.carve(self.map, points, cloud.times, placement.origins(cloud))
        return Drawn(report, carved if before is None or carved is None else before + carved)

    def _draw_moving(self, placement: Placement) -> InsertReport:
        clouds, above = list(self._moving), self._new()
        ends = np.cumsum([len(cloud) for cloud in clouds])
        everything = placement.points(TimedPoints.joined(clouds))
        points = np.split(everything, ends[:-1])
        # All but the newest at once, whose report is wanted: blocks do not depend on the order.
        above.insert(everything[: len(everything) - len(points[-1])])
        report = above.insert(points[-1])
        self._above = above.blocks
        self._overlay.lay(self._above)
        self.free.look(self.map, clouds, points, placement)
        self._overlay.hide(self.free.outworn(self.map))
        return report
