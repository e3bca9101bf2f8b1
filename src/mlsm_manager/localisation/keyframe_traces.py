"""What keyframes leave in the map: free space, and what is settled of them, which moves when a loop bends the path.

What keyframes that may still move say of free space is found anew when they have moved. Those that are settled are not
kept, as their points would fill the memory of a long run: what those of a stretch of the path drew is kept as blocks,
which move with the path in the middle of it.
"""

from collections import deque
from dataclasses import dataclass
from threading import RLock
from typing import Deque, List, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.localisation.clouds import Placement
from mlsm_manager.surface_map.block_store import RunningCopy, finished
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.free_space import BeamFindings, Carver, CarveReport, FirstEchoes, pairs_of_groups
from mlsm_manager.surface_map.insertion import blocks_of
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap, Overlay
from mlsm_manager.surface_map.operations import LevelTransform, moved
from node_support.geometry import keys_of, move_of

_STRAYED = 0.5  # of a cell, by which a keyframe must have moved to be followed anew: less changes few free cells
MOST_FOLLOWED = 2
"""The beams of so many moving keyframes are followed with each scan: those that moved farthest, and a new one before
them. More would take over a fifth of the time of a scan. What settles is followed in any case."""

Beams = Tuple[np.ndarray, np.ndarray, np.ndarray]
"""Of a keyframe: points (n, 4) in map, the times (n,) [s] of their beams, and where the sonar was then, (n, 2) m."""


@dataclass(frozen=True)
class _Look:
    """points: (n, 4) of a keyframe in map when its beams were followed. findings: what they said then."""

    points: np.ndarray
    findings: BeamFindings


class KeyframeCarving:
    """The free space of a KeyframeMap, and which of its blocks must go because beams go through them.

    Keyframes that are settled carve for ever, in the order of time. What the others say is kept beside the map.
    settled: what these know to be free.
    """

    def __init__(self, resolution: float, limit: float, carver: Optional[Carver], most_followed: int) -> None:
        """`carver`: None where nothing is to be carved. most_followed: keyframes that may still move and whose beams
        are followed with each scan; with 0 only those that settle carve.
        """
        self._carver = carver
        self._most_followed = most_followed
        self.settled = MultiLevelSurfaceMap(resolution, limit)
        self._looks: Deque[Optional[_Look]] = deque()
        self._hit_cells, self._hit_by = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)

    @property
    def blocks(self) -> Blocks:
        """A copy of what is known to be free, as all keyframes see it now."""
        return finished(self.begin_copy(), RLock())

    def begin_copy(self) -> RunningCopy:
        """Return a copy of what is known to be free now, which is still to be made."""
        overlay = Overlay(self.settled)
        for look in self._looks:
            if look is not None:
                overlay.lay(look.findings.free)
        copy = self.settled.begin_copy()
        overlay.take_off()
        return copy

    def restore(self, free: Blocks) -> None:
        """Take what was known to be free. Raises ValueError for another resolution."""
        self.settled.insert_blocks(free)

    def carve(
        self, surface_map: MultiLevelSurfaceMap, points: np.ndarray, times: np.ndarray, origins: np.ndarray
    ) -> Tuple[Optional[CarveReport], Optional[Blocks]]:
        """Carve for ever along the beams of points (n, 4) in the map, taken at `times` (n,) s from `origins` (n, 2) m.

        Return a report and what was not known to be free; None of both where nothing is to be carved. Nobody looks at
        the free space of a map whose moving keyframes are not followed: what is known of it is not told.
        """
        if self._carver is None:
            return None, None
        beams = FirstEchoes.of_level(points, times, origins)
        report, noted = self._carver.carve(surface_map, self.settled, beams, points)
        return report, noted if self._most_followed else None

    def forget_oldest(self) -> None:
        """Forget what the oldest keyframe said, because it is settled."""
        if self._looks:
            self._looks.popleft()

    def keep_oldest(self, count: int) -> None:
        """Forget what keyframes said after the oldest `count`."""
        while len(self._looks) > count:
            self._looks.pop()

    def look(self, surface_map: MultiLevelSurfaceMap, keyframes: Sequence[Beams], scans: int = 1) -> None:
        """Follow the beams of moving keyframes that are new or have moved; all of them are in the map.

        scans: how many came since the last look.
        """
        if self._carver is None or not self._most_followed:
            return
        points = [there for there, _, _ in keyframes]
        self._looks.extend([None] * (len(keyframes) - len(self._looks)))
        moved_by = np.full(len(points), np.inf)
        for number, look in enumerate(self._looks):
            if look is not None:
                moved_by[number] = np.abs(points[number] - look.points)[:, :2].max(initial=0.0)
        for number in np.argsort(-moved_by, kind="stable")[: self._most_followed * scans]:
            if moved_by[number] > _STRAYED * surface_map.resolution:
                beams = FirstEchoes.of_level(*keyframes[number])
                self._looks[number] = _Look(points[number], self._carver.findings(surface_map, beams, points[number]))
        # The newest keyframe with a point in each cell.
        keys = keys_of(np.concatenate(points), surface_map.resolution)
        by = np.repeat(np.arange(len(points)), [len(part) for part in points])
        self._hit_cells, last = np.unique(keys[::-1], return_index=True)
        self._hit_by = by[::-1][last]

    def outworn(self, surface_map: MultiLevelSurfaceMap) -> Tuple[Blocks, np.ndarray]:
        """Return blocks of the map that go if the moving keyframes are where they are thought to be, and their rows.

        A keyframe with a point in a cell ends the count of the crossings that older ones saw there.
        """
        looks = [(number, look.findings) for number, look in enumerate(self._looks) if look is not None]
        if not looks:
            return Blocks.none(surface_map.resolution), np.empty(0, dtype=np.int64)
        crossed = Blocks.joined([findings.crossed for _, findings in looks])
        keys = crossed.keys
        beams = np.concatenate([findings.beams for _, findings in looks])
        number = np.repeat([number for number, _ in looks], [len(findings.beams) for _, findings in looks])
        hit = np.minimum(np.searchsorted(self._hit_cells, keys), len(self._hit_cells) - 1)
        counts = (self._hit_cells[hit] != keys) | (number > self._hit_by[hit])
        keys, crossed, beams = keys[counts], crossed.take(counts), beams[counts]
        order = np.argsort(keys, kind="stable")
        cells, starts = np.unique(keys[order], return_index=True)
        blocks, rows, owners = surface_map.find(cells)
        block, entry = pairs_of_groups(starts, len(keys), owners)
        entry = order[entry]
        same = blocks.take(block).gaps(crossed, entry) <= 0.0
        more = np.bincount(block[same], weights=beams[entry[same]], minlength=len(blocks))
        gone = (more > 0) & self._carver.is_outworn(blocks, blocks.crossed + more)
        return blocks.take(gone), rows[gone]


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
        x, y, yaw = move_of(self.pose, pose)
        T_new_old = LevelTransform(x=x, y=y, yaw=yaw)
        return _Stretch(self.keyframes, self.time, pose, moved(self.drawn, T_new_old), moved(self.free, T_new_old))

    def without_what_is_gone(self, surface_map: MultiLevelSurfaceMap) -> "_Stretch":
        """Return it without blocks of which the map holds nothing any more, because beams went through them."""
        there, _, owners = surface_map.find(self.drawn.keys)
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
