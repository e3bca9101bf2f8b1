"""A map drawn from keyframes: clouds whose places may still change are kept as points and drawn anew when they do."""

from collections import deque
from typing import Callable, Deque

import numpy as np

from mlsm_manager.localisation.timed_points import TimedPoints
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.insertion import InsertionKernel
from mlsm_manager.surface_map.mlsm import InsertReport, MultiLevelSurfaceMap

Place = Callable[[TimedPoints], np.ndarray]
"""Returns the points (n, 4) of a cloud in map, as they are known now."""


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
    ) -> None:
        """As MultiLevelSurfaceMap."""
        self.map = MultiLevelSurfaceMap(resolution, limit, expected_blocks, kernel)
        self._moving: Deque[TimedPoints] = deque()
        self._above = self._covered = self._new().blocks

    def _new(self) -> MultiLevelSurfaceMap:
        return MultiLevelSurfaceMap(self.map.resolution, self.map.limit)

    @property
    def keyframes(self) -> int:
        """Number of keyframes that may still move."""
        return len(self._moving)

    def insert(self, points: np.ndarray) -> InsertReport:
        """Insert points (n, 4) in map whose places will not change."""
        self._uncover()
        report = self.map.insert(points)
        self._cover(self._above)
        return report

    def add(self, cloud: TimedPoints) -> None:
        """Add a keyframe; it is in the map from the next `draw` on."""
        self._moving.append(cloud)

    def draw(self, place: Place, settled_until: float) -> InsertReport:
        """Draw all keyframes where they are now; those that end by `settled_until` [s] stay as they are drawn.

        The report is that of the newest keyframe.
        """
        self._uncover()
        report = InsertReport(0, 0, 0)
        while self._moving and self._moving[0].end <= settled_until:
            report = self.map.insert(place(self._moving.popleft()))
        above = self._new()
        for cloud in self._moving:
            report = above.insert(place(cloud))
        self._cover(above.blocks)
        return report

    def settle(self, place: Place) -> None:
        """Draw all keyframes for the last time."""
        if self._moving:
            self.draw(place, np.inf)

    def _cover(self, above: Blocks) -> None:
        self._above = above
        self._covered, _, _ = self.map.find(self._cells())
        self.map.insert_blocks(above)

    def _uncover(self) -> None:
        """Take off what the keyframes added to their cells."""
        _, rows, _ = self.map.find(self._cells())
        self.map.remove(rows)
        self.map.insert_blocks(self._covered)

    def _cells(self) -> np.ndarray:
        # Without blocks numpy 1.17 cannot tell their rows apart.
        return np.unique(self._above.cells, axis=0) if len(self._above) else self._above.cells
