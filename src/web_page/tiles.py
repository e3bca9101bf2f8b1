"""The map from above in tiles: which cells hold something, how surely, and since when."""

from typing import Callable, Set, Tuple

import numpy as np

from node_support.geometry import cell_keys, cells_of_keys
from web_page.messages import tile_bytes

SIDE = 32  # cells along a side of a tile
BORN_STEP = 2.0  # s: step of the times at which cells were first seen; 16 bits hold 36 hours
_FARTHEST_TILE = 32767
_LEVELS_PER_DOUBLING = 8.0
_STEPS = 65535


class MapTiles:
    """Compares each map with the one before, and tells which tiles changed."""

    def __init__(self, put: Callable[[Tuple[int, int], bytes], None]) -> None:
        """`put` takes a tile that changed, and its bytes."""
        self._put = put
        self.clear()

    def clear(self) -> None:
        """Forget when cells were first seen, because time jumped."""
        self._keys, self._born = np.empty(0, np.int64), np.empty(0, np.int64)
        self._shown: Set[Tuple[int, int]] = set()

    @property
    def cells(self) -> int:
        return len(self._keys)

    def take(self, points: np.ndarray, counts: np.ndarray, cell: float, time: float) -> None:
        """Take all blocks of the map: means x, y (n, 2) [m], and how many points each holds (n,).

        cell: side of a cell, m. time: since the run began, s.
        """
        known = np.isfinite(points).all(axis=1) & (counts > 0.0)
        points, counts = points[known], counts[known]
        corners = np.floor(points / cell)
        inside = (np.abs(corners) < _FARTHEST_TILE * SIDE).all(axis=1)
        corners, points, counts = corners[inside].astype(np.int64), points[inside], counts[inside]
        keys, owner = np.unique(cell_keys(corners), return_inverse=True)
        total = np.bincount(owner, counts, len(keys))
        means = np.column_stack([np.bincount(owner, counts * axis, len(keys)) / total for axis in points.T])
        self._remember(keys, time)
        self._tell(keys, means, total, cell)

    def _remember(self, keys: np.ndarray, time: float) -> None:
        """Carry on when each cell was first seen."""
        born = np.full(len(keys), min(int(time / BORN_STEP), _STEPS))
        if len(self._keys):
            place = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
            same = self._keys[place] == keys
            born[same] = self._born[place[same]]
        self._keys, self._born = keys, born

    def _tell(self, keys: np.ndarray, means: np.ndarray, total: np.ndarray, cell: float) -> None:
        cells = cells_of_keys(keys)
        tiles, owner = np.unique(cell_keys(cells // SIDE), return_inverse=True)
        order = np.argsort(owner, kind="stable")
        ends = np.cumsum(np.bincount(owner, minlength=len(tiles)))
        columns = _columns(cells, means, total, cell, self._born)
        told = dict(zip(map(tuple, cells_of_keys(tiles).tolist()), np.split(order, ends[:-1])))
        for tile in self._shown - set(told):
            self._put(tile, tile_bytes(*tile, columns[:, :0]))
        for tile, part in told.items():
            self._put(tile, tile_bytes(*tile, columns[:, part]))
        self._shown = set(told)


def _columns(cells: np.ndarray, means: np.ndarray, total: np.ndarray, cell: float, born: np.ndarray) -> np.ndarray:
    """Return (4, n) whole numbers as `tile_bytes` takes them."""
    column, row = (cells % SIDE).T
    level = np.minimum(np.rint(_LEVELS_PER_DOUBLING * np.log2(1.0 + total)), 255)
    within = np.clip(np.floor((means / cell - cells) * 16.0), 0, 15)
    parts = (row * SIDE + column, born, level, within[:, 0] * 16 + within[:, 1])
    return np.array([part.astype(np.int64) for part in parts]).reshape(4, -1)
