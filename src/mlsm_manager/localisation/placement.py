"""Where clouds are in map."""

from typing import Protocol

import numpy as np

from mlsm_manager.localisation.timed_points import TimedPoints


class Placement(Protocol):
    """Places clouds as it is known now."""

    def points(self, cloud: TimedPoints) -> np.ndarray:
        """Return the points (n, 4) of a cloud in map."""

    def origins(self, cloud: TimedPoints) -> np.ndarray:
        """Return where the sonar was in map when it heard each of them, (n, 2) m."""
