"""Where clouds are in map."""

from typing import Protocol

import numpy as np

from mlsm_manager.localisation.clouds import MapCloud


class Placement(Protocol):
    """Places clouds as it is known now: the joint solver's Solution, or a run in a map that had another odometry."""

    def points(self, cloud: MapCloud) -> np.ndarray:
        """Return the points (n, 4) of a cloud in map."""

    def origins(self, cloud: MapCloud) -> np.ndarray:
        """Return where the sonar was in map when it heard each of them, (n, 2) m."""
