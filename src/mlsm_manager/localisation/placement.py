"""Where clouds are in map."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mlsm_manager.joint_solver.motion_models import OdometryModel
from mlsm_manager.joint_solver.normal_equations import DELAY, State
from mlsm_manager.joint_solver.placement import corrected_path, drawn
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.localisation.clouds import MapCloud
from node_support.geometry import transformed


class Placement(Protocol):
    """Places clouds as it is known now."""

    def points(self, cloud: MapCloud) -> np.ndarray:
        """Return the points (n, 4) of a cloud in map."""

    def origins(self, cloud: MapCloud) -> np.ndarray:
        """Return where the sonar was in map when it heard each of them, (n, 2) m."""


@dataclass(frozen=True)
class SolvedPlacement:
    """Places clouds where the unknowns `state` of the joint solver say that they lie."""

    log: RunLog
    odometry: OdometryModel
    state: State

    def points(self, cloud: MapCloud) -> np.ndarray:
        """Return the points (n, 4) of a cloud in map."""
        return drawn(self.log, self.odometry, self.state, cloud.points, cloud.times)

    def origins(self, cloud: MapCloud) -> np.ndarray:
        """Return where the sonar was in map when it heard each of them, (n, 2) m."""
        path = self.path(cloud.times + self.state.run[DELAY])
        return transformed(path, np.broadcast_to(self.log.sonar_in_base, (len(path), 2)))

    def path(self, times: np.ndarray) -> np.ndarray:
        """Return T_map_base (m, 3) at `times` (m,) [s]."""
        return corrected_path(self.log, self.odometry, self.state, times)
