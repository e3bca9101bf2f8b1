"""What the live solver knows when a scan has ended."""

from dataclasses import dataclass

import numpy as np

from mlsm_manager.multi_view.state import DELAY, POSE, RANGE_SCALE, RUN_COLUMNS


@dataclass(frozen=True)
class LiveEstimate:
    """Known from the scan that ended at `time` [s] and those before it.

    T_odom_base: (3,) then, x y [m], yaw [rad]. T_map_base: (3,) then. T_map_odom: (3,) the correction. node: (width,)
    the newest node's unknowns. run: (2,) the run's unknowns. covariance: (width + 2, width + 2) of both.
    own_covariance: the same if the frozen map had no error. comparisons: number of points compared with surfaces.
    agreement: share of the scan's points with neighbours in other scans that lie on the surfaces of these. distance: m,
    mean distance of the scan's points from these surfaces.
    """

    time: float
    T_odom_base: np.ndarray
    T_map_base: np.ndarray
    T_map_odom: np.ndarray
    node: np.ndarray
    run: np.ndarray
    covariance: np.ndarray
    own_covariance: np.ndarray
    comparisons: int
    agreement: float
    distance: float

    @property
    def pose_covariance(self) -> np.ndarray:
        """(3, 3) of T_map_base: m^2, m rad, rad^2."""
        return self.covariance[POSE, POSE]

    @property
    def node_deviations(self) -> np.ndarray:
        """(width,) standard deviations of `node` if the frozen map had no error."""
        return np.sqrt(np.diag(self.own_covariance)[:-RUN_COLUMNS])

    @property
    def run_deviations(self) -> np.ndarray:
        """(2,) standard deviations of `run` if the frozen map had no error."""
        return np.sqrt(np.diag(self.own_covariance)[-RUN_COLUMNS:])

    @property
    def range_scale(self) -> float:
        """True range over reported range, minus 1."""
        return float(self.run[RANGE_SCALE])

    @property
    def sonar_delay(self) -> float:
        """Seconds by which beams are later than their stamps."""
        return float(self.run[DELAY])
