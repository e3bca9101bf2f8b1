"""What a run settled in a map, stretch by stretch of its path, so that it moves when a loop bends the path.

Keyframes that are settled are not kept: their points would fill the memory of a long run. What those of a stretch drew
is kept as blocks, which move with the path in the middle of it.
"""

from dataclasses import dataclass
from typing import List, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.localisation.clouds import Placement
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.insertion import blocks_of
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from mlsm_manager.surface_map.operations import LevelTransform, moved
from node_support.geometry import composed, inverse

# So many stretches, or so many blocks in all for each block of the map: of more, two neighbours make one.
_MOST, _MOST_TIMES = 500, 5
_FEWEST_BLOCKS = 10_000  # are kept at any rate


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
        holds[owners[there.gaps(drawn, owners) <= 0.0]] = True
        return _Stretch(self.keyframes, self.time, self.pose, drawn.take(holds), self.free)


class Stretches:
    """The stretches of a run in a map that held nothing before."""

    def __init__(self, resolution: float) -> None:
        self._none = Blocks.none(resolution)
        self._closed: List[_Stretch] = []
        self._begin()

    def _begin(self) -> None:
        self._newest: Optional[Tuple[float, np.ndarray]] = None
        self._drawn, self._free = self._none, [self._none]

    def add(self, end: float, points: np.ndarray, placement: Placement, in_map: int) -> None:
        """Add a keyframe that ends at `end` [s] and settles at points (n, 4) in map.

        in_map: number of blocks of the map, to which memory is bounded where the vehicle stays in one place.
        """
        self._close()
        while len(self._closed) > _MOST or self.block_count > _FEWEST_BLOCKS + _MOST_TIMES * in_map:
            self._join_two()
        self._drawn = Blocks.joined([self._drawn, blocks_of(points, self._none.resolution)])
        self._newest = end, placement.path(np.array([end]))[0]

    def insert(self, points: np.ndarray) -> None:
        """Add points (n, 4) in map of no keyframe."""
        self._drawn = _merged([self._drawn, blocks_of(points, self._none.resolution)])

    def note_free(self, blocks: Blocks) -> None:
        """Add cells that the newest keyframe saw through first."""
        self._free.append(blocks)

    def _close(self) -> None:
        if self._newest is None:
            return
        self._closed.append(_Stretch(1, *self._newest, _light(self._drawn), _light(Blocks.joined(self._free))))
        self._begin()

    @property
    def block_count(self) -> int:
        """How many blocks the closed stretches hold."""
        return sum(len(one.drawn.rows) for one in self._closed)

    def _join_two(self) -> None:
        """Join two neighbours with few keyframes and many after them: what bends is mostly the newest path."""
        counts = np.array([one.keyframes for one in self._closed])
        since = np.cumsum(counts[::-1])[::-1]
        fewest = int(np.argmin((counts[1:] + counts[:-1]) / since[1:]))
        first, second = self._closed[fewest : fewest + 2]
        drawn, free = (_light(_merged(each)) for each in ((first.drawn, second.drawn), (first.free, second.free)))
        together = _Stretch(first.keyframes + second.keyframes, first.time, first.pose, drawn, free)
        self._closed[fewest : fewest + 2] = [together]

    def redraw(self, drawn: MultiLevelSurfaceMap, free: MultiLevelSurfaceMap, placement: Placement) -> None:
        """Draw both maps, which hold nothing but this run, anew with the stretches where the path is now."""
        self._close()
        there = [one.without_what_is_gone(drawn) for one in self._closed]
        poses = placement.path(np.array([one.time for one in there]))
        self._closed = [one.at(pose) for one, pose in zip(there, poses)]
        drawn.replace([one.drawn for one in self._closed])
        free.replace([one.free for one in self._closed])


def _merged(parts: Sequence[Blocks]) -> Blocks:
    merged = MultiLevelSurfaceMap(parts[0].resolution, np.inf)
    for blocks in parts:
        merged.insert_blocks(blocks)
    return merged.blocks


def _light(blocks: Blocks) -> Blocks:
    """Return blocks in half the memory, exact to a tenth of a millimetre some kilometres away."""
    return Blocks(blocks.rows.astype(np.float32), blocks.resolution, blocks.crossed)
