"""Clouds that came before the scan of their time: they are in the map, but where they were heard is not known yet."""

from collections import deque
from typing import Callable, Deque, Optional

import numpy as np

from mlsm_manager.localisation.correction_history import CorrectionHistory
from mlsm_manager.localisation.map_updates import MOST_WAITING, NOTHING_INSERTED, CloudUpdate
from mlsm_manager.surface_map.free_space.carving import CarveReport

Carve = Callable[[np.ndarray, np.ndarray, np.ndarray], Optional[CarveReport]]
"""Takes points (n, 4) in map, times (n,) s of their beams, and origins (n, 2) m in map, where they were heard from."""


class UncarvedClouds:
    """Keeps such clouds, oldest first, until a history tells where the vehicle was."""

    def __init__(self) -> None:
        self._waiting: Deque[tuple] = deque(maxlen=MOST_WAITING)

    def append(self, points: np.ndarray, times: np.ndarray) -> None:
        """Keep points (n, 4) in map, of beams taken at `times` (n,) s; those of an empty cloud tell nothing."""
        if len(points):
            self._waiting.append((points, times))

    def clear(self) -> None:
        """Forget them all: their places are not known any more."""
        self._waiting.clear()

    def carve_next(self, history: CorrectionHistory, sonar_in_base: np.ndarray, carve: Carve) -> Optional[CloudUpdate]:
        """Carve with the next cloud whose time the history knows, and forget it; None where there is none.

        sonar_in_base: (2,) m. Clouds from before the history begins are forgotten: it will never know them.
        """
        while self._waiting and history.reaches(self._waiting[0][1]):
            points, times = self._waiting.popleft()
            origins = history.origins(times, sonar_in_base)
            if origins is not None:
                return CloudUpdate(NOTHING_INSERTED, False, 0, carve(points, times, origins))
        return None
