"""What a run settled in a map, stretch by stretch of its path, so that it moves when a loop bends the path.

Keyframes that are settled are not kept: their points would fill the memory of a long run. What those of a stretch drew
is kept as blocks, which move with the path in the middle of it.
"""

from dataclasses import dataclass
from typing import List, Optional, Tuple

import numpy as np

from mlsm_manager.localisation.clouds import Placement
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from mlsm_manager.surface_map.operations import LevelTransform, moved
from node_support.geometry import composed, inverse

_MOST = 500  # stretches: of more, the two neighbours with the fewest keyframes make one, so that memory is bounded


@dataclass(frozen=True)
class _Stretch:
    """keyframes: how many. time: s, in it. pose: (3,) T_map_base then, when `drawn` and `free` lay where they are."""

    keyframes: int
    time: float
    pose: np.ndarray
    drawn: Blocks
    free: Blocks

    def at(self, pose: np.ndarray) -> "_Stretch":
        """Return it moved with the path to a new `pose` (3,)."""
        x, y, yaw = composed(pose, inverse(self.pose))
        T_new_old = LevelTransform(x=x, y=y, yaw=yaw)
        return _Stretch(self.keyframes, self.time, pose, moved(self.drawn, T_new_old), moved(self.free, T_new_old))

    def without_what_is_gone(self, surface_map: MultiLevelSurfaceMap) -> "_Stretch":
        """Return it without blocks of which the map holds nothing any more, because beams went through them."""
        there, _, owners = surface_map.find(self.drawn.cells)
        drawn, holds = self.drawn, np.zeros(len(self.drawn), dtype=bool)
        overlap = (there.bottom <= drawn.height[owners]) & (there.height >= drawn.bottom[owners])
        holds[owners[overlap]] = True
        return _Stretch(self.keyframes, self.time, self.pose, drawn.take(holds), self.free)


class Stretches:
    """The stretches of a run in a map that held nothing before. free: cells that the newest one saw through first."""

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution
        self._closed: List[_Stretch] = []
        self._begin()

    def _begin(self) -> None:
        self._newest: Optional[Tuple[float, np.ndarray]] = None
        self._drawn, self.free = (MultiLevelSurfaceMap(self._resolution, np.inf) for _ in range(2))

    def add(self, end: float, points: np.ndarray, placement: Placement) -> None:
        """Add a keyframe that ends at `end` [s] and settles at points (n, 4) in map."""
        self._close()
        self._drawn.insert(points)
        self._newest = end, placement.path(np.array([end]))[0]

    def insert(self, points: np.ndarray) -> None:
        """Add points (n, 4) in map of no keyframe."""
        self._drawn.insert(points)

    def _close(self) -> None:
        if self._newest is None:
            return
        kept = (_light(blocks) for blocks in (self._drawn.blocks, self.free.blocks))
        self._closed.append(_Stretch(1, *self._newest, *kept))
        self._begin()
        if len(self._closed) > _MOST:
            counts = np.array([one.keyframes for one in self._closed])
            fewest = int(np.argmin(counts[1:] + counts[:-1]))
            self._closed[fewest : fewest + 2] = [self._joined(*self._closed[fewest : fewest + 2])]

    def _joined(self, first: _Stretch, second: _Stretch) -> _Stretch:
        drawn, free = (MultiLevelSurfaceMap(self._resolution, np.inf) for _ in range(2))
        for one in (first, second):
            drawn.insert_blocks(one.drawn)
            free.insert_blocks(one.free)
        return _Stretch(
            first.keyframes + second.keyframes, first.time, first.pose, _light(drawn.blocks), _light(free.blocks)
        )

    def redraw(self, drawn: MultiLevelSurfaceMap, free: MultiLevelSurfaceMap, placement: Placement) -> None:
        """Draw both maps, which hold nothing but this run, anew with the stretches where the path is now."""
        self._close()
        there = [one.without_what_is_gone(drawn) for one in self._closed]
        poses = placement.path(np.array([one.time for one in there]))
        self._closed = [one.at(pose) for one, pose in zip(there, poses)]
        drawn.replace([one.drawn for one in self._closed])
        free.replace([one.free for one in self._closed])


def _light(blocks: Blocks) -> Blocks:
    """Return blocks in half the memory, exact to a tenth of a millimetre some kilometres away."""
    return Blocks(blocks.rows.astype(np.float32), blocks.resolution, blocks.crossed)
