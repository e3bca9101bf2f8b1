"""What users say of a sonar: the width of its beam, where it hangs, and the errors of its stamps and ranges."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from node_support.geometry import pose_matrix
from node_support.parameters import ParameterSet, parameter
from sonar_processing.beams.beam import Beam

# Imagenex 852: 2.5 degrees (thesis 4.1).
_IMAGENEX_852 = 0.0436
_FARTHEST = 100.0  # m: no sonar hangs farther from its vehicle


def beam_width_parameter(text: str = "horizontal width of the beam") -> Any:
    """Declare the field `beam_width` of a ParameterSet."""
    return parameter(_IMAGENEX_852, text, unit="rad", low=0.0, high=0.5)


@dataclass(frozen=True)
class SonarPoseParameters(ParameterSet):
    """The sonar's pose in a frame of the vehicle, used where tf does not know the frame of the beams."""

    mounted_in: str = parameter(
        "", "frame of the vehicle that mount_* refer to, used where tf does not know the sonar; empty: tf must know it",
        tunable=False, may_be_empty=True,
    )  # fmt: skip
    mount_x: float = parameter(
        0.0, "how far the sonar is ahead of the origin of mounted_in", unit="m", low=-_FARTHEST, high=_FARTHEST,
        tunable=False,
    )  # fmt: skip
    mount_y: float = parameter(
        0.0, "how far it is to the left", unit="m", low=-_FARTHEST, high=_FARTHEST, tunable=False
    )  # fmt: skip
    mount_z: float = parameter(0.0, "how far it is above", unit="m", low=-_FARTHEST, high=_FARTHEST, tunable=False)
    mount_yaw: float = parameter(
        0.0, "direction of the sonar's +x, counter-clockwise from the bow",
        unit="rad", low=-2.0 * math.pi, high=2.0 * math.pi, tunable=False,
    )  # fmt: skip
    upside_down: bool = parameter(
        False, "the sonar hangs upside down: its head turns the other way round", tunable=False
    )

    def matrix(self) -> np.ndarray:
        """Return (4, 4) T_vehicle_sonar."""
        roll = math.pi if self.upside_down else 0.0
        return pose_matrix((self.mount_x, self.mount_y, self.mount_z), (roll, 0.0, self.mount_yaw))


@dataclass(frozen=True)
class BeamCorrection(ParameterSet):
    """Known errors of a sonar's stamps and ranges, both of which map_bag estimates, and where echoes are drawn."""

    sonar_delay: float = parameter(
        0.0, "added to the stamps of beams to match those of the odometry", unit="s", low=-10.0, high=10.0,
        tunable=False,
    )  # fmt: skip
    range_scale: float = parameter(
        1.0, "true range divided by reported range; differs from 1 where the speed of sound does", low=0.5, high=2.0,
        tunable=False,
    )  # fmt: skip
    bin_place: float = parameter(
        0.5, "where in its bin an echo is drawn: 0 the near end, 0.5 the middle, 1 the far end as in the thesis",
        low=0.0, high=1.0, tunable=False,
    )  # fmt: skip

    def corrected(self, beam: Beam) -> Beam:
        """Return the corrected beam; raises RefusedInput when its stamp would be below 0."""
        return replace(
            beam,
            stamp_ns=beam.stamp_ns + round(self.sonar_delay * 1e9),
            range_resolution=beam.range_resolution * self.range_scale,
            bin_place=self.bin_place,
        )
