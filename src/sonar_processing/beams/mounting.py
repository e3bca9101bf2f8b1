"""Where a sonar is mounted, for vehicles whose tf does not say."""

import math
from dataclasses import dataclass

import numpy as np

from node_support.geometry import pose_matrix
from node_support.parameters import ParameterSet, parameter

_FARTHEST = 100.0  # m: no sonar hangs farther from its vehicle


@dataclass(frozen=True)
class MountingParameters(ParameterSet):
    """The sonar's pose in a frame of the vehicle, used where tf does not know the frame of the beams."""

    mounted_in: str = parameter(
        "", "frame of the vehicle in which mount_* place the sonar where tf does not know it; empty: tf must know it",
        tunable=False, may_be_empty=True,
    )  # fmt: skip
    mount_x: float = parameter(
        0.0, "sonar ahead of that frame's origin", unit="m", low=-_FARTHEST, high=_FARTHEST, tunable=False
    )
    mount_y: float = parameter(
        0.0, "sonar to the left of it", unit="m", low=-_FARTHEST, high=_FARTHEST, tunable=False
    )  # fmt: skip
    mount_z: float = parameter(0.0, "sonar above it", unit="m", low=-_FARTHEST, high=_FARTHEST, tunable=False)
    mount_yaw: float = parameter(
        0.0, "where +x of the sonar points, counter-clockwise from the vehicle's bow", unit="rad",
        low=-2.0 * math.pi, high=2.0 * math.pi, tunable=False,
    )  # fmt: skip
    upside_down: bool = parameter(
        False, "the head hangs the other way up, so that it turns the other way round", tunable=False
    )

    def matrix(self) -> np.ndarray:
        """Return (4, 4) T_vehicle_sonar."""
        roll = math.pi if self.upside_down else 0.0
        return pose_matrix((self.mount_x, self.mount_y, self.mount_z), (roll, 0.0, self.mount_yaw))
