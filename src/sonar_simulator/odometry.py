"""What the vehicle believes of its own motion (thesis 7.4)."""

from dataclasses import dataclass

import numpy as np

from node_support.parameters import ParameterSet, parameter


@dataclass(frozen=True)
class OdometryParameters(ParameterSet):
    """The error of the odometry."""

    scale_error: float = parameter(
        0.3, "the vehicle really moves 1 + scale_error times what odometry says", low=-0.9, high=10.0
    )


@dataclass(frozen=True)
class Odometry:
    """Odometry whose distances are off by a factor and whose heading is true.

    The odom frame coincides with the world frame. start: (4, 4) T_world_base at which odometry is right.
    """

    parameters: OdometryParameters
    start: np.ndarray

    def pose(self, T_world_base: np.ndarray) -> np.ndarray:
        """Return the (4, 4) T_odom_base that odometry gives for the true pose."""
        T_odom_base = T_world_base.copy()
        T_odom_base[:3, 3] = self.start[:3, 3] + (T_world_base[:3, 3] - self.start[:3, 3]) * self._scale
        return T_odom_base

    def twist(self, true_twist: np.ndarray) -> np.ndarray:
        """Return the (6,) body twist, m/s and rad/s, that odometry gives for the true one."""
        return true_twist * np.array([self._scale] * 3 + [1.0] * 3)

    @property
    def _scale(self) -> float:
        return 1.0 / (1.0 + self.parameters.scale_error)
