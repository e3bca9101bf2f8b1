"""A copy of a map's blocks that is made in pieces while the map goes on changing."""

import time
from threading import RLock
from typing import List, Tuple

import numpy as np

from mlsm_manager.surface_map.blocks import COUNT, Blocks
from mlsm_manager.surface_map.large_array import LargeArray

_PIECE = 1 << 15
"""Rows copied at once: 3 MB, one or two milliseconds."""
_PAUSE = 0.001
"""s between two pieces: a lock that is taken again at once is never given to somebody who waits for it."""


class RunningCopy:
    """The blocks as they were when it began.

    The map tells which rows it is about to change; those that are not copied yet are put aside as they are.
    """

    def __init__(self, rows: LargeArray, crossed: LargeArray, used: int, resolution: float) -> None:
        """`rows`, `crossed`: of the map, whose first `used` elements are copied. resolution: side of a cell, m."""
        self._rows, self._crossed, self._resolution = rows, crossed, resolution
        self._copy = np.empty((used, *rows.values.shape[1:])), np.empty(used, dtype=crossed.values.dtype)
        self._done = 0
        self._aside: List[Tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    @property
    def is_complete(self) -> bool:
        """Whether nothing is left to copy."""
        return self._done == len(self._copy[1])

    def before_change(self, rows: np.ndarray) -> None:
        """Learn that the map is about to change `rows` (n,)."""
        left = rows[(rows >= self._done) & (rows < len(self._copy[1]))]
        if len(left):
            self._aside.append((left, self._rows.values[left], self._crossed.values[left]))

    def step(self) -> None:
        """Copy the next piece; the map must not change meanwhile."""
        piece = slice(self._done, min(self._done + _PIECE, len(self._copy[1])))
        for copy, array in zip(self._copy, (self._rows, self._crossed)):
            copy[piece] = array.values[piece]
        self._done = piece.stop

    @property
    def blocks(self) -> Blocks:
        """All blocks, in no particular order, once the copy is complete."""
        rows, crossed = self._copy
        while self._aside:
            # What was put aside first is the oldest, and counts.
            places, before, before_crossed = self._aside.pop()
            rows[places], crossed[places] = before, before_crossed
        held = np.flatnonzero(rows[:, COUNT])
        if len(held) == len(rows):
            return Blocks(rows, self._resolution, crossed)
        return Blocks(rows[held], self._resolution, crossed[held])


def finished(copy: RunningCopy, lock: RLock) -> Blocks:
    """Complete a copy, holding the lock of its map for one piece at a time, and return the blocks."""
    while True:
        with lock:
            copy.step()
        if copy.is_complete:
            return copy.blocks
        time.sleep(_PAUSE)
