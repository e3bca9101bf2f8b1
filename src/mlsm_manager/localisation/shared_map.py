"""The map as others read it while scans are taken: shown, saved and cut by several threads."""

import threading
from typing import Tuple

import numpy as np

from mlsm_manager.localisation.scan_mapper import ScanMapper
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.files.map_file import Layer
from mlsm_manager.surface_map.running_copy import finished


class SharedMap:
    """Reads the map of a mapper under the lock of the localiser that changes it."""

    def __init__(self, mapper: ScanMapper, lock: threading.RLock) -> None:
        self._mapper = mapper
        self._lock = lock
        self._changes = 0

    @property
    def changes(self) -> int:
        """A number that grows whenever the map or the pose in it changes."""
        return self._changes

    def change(self) -> None:
        """Count a change. The caller holds the lock."""
        self._changes += 1

    @property
    def blocks(self) -> Blocks:
        """A copy of the map that is shown and saved."""
        return self._copied(Layer.SHOWN)

    @property
    def free(self) -> Blocks:
        """A copy of what is known to be free."""
        return self._copied(Layer.FREE)

    @property
    def block_count(self) -> int:
        """Number of blocks of the map that is shown."""
        with self._lock:
            return self._mapper.block_count

    def region(self, low: np.ndarray, high: np.ndarray) -> Blocks:
        """Return the blocks of the map that is shown whose mean lies from `low` to `high`, (2,) or (3,) m."""
        with self._lock:
            return self._mapper.region(low, high)

    def changed_tiles(self) -> Tuple[np.ndarray, Blocks]:
        """Return the tiles (n, 2) of the map that is shown that changed since the last call, and their blocks."""
        with self._lock:
            return self._mapper.changed_tiles()

    def _copied(self, layer: Layer) -> Blocks:
        with self._lock:
            copy = self._mapper.begin_copy(layer)
        return finished(copy, self._lock)
