"""A beam and where it was sent."""

from dataclasses import dataclass

import numpy as np

from sonar_processing.beams.beam import Beam

SERVO_DEAD_BAND = 1e-3  # rad: a servo that holds its place trembles by less, and none steps by as little


@dataclass(frozen=True)
class PlacedBeam:
    """A beam, its pose when the ping left (T_target_sonar, (4, 4)) and whether the vehicle moved."""

    beam: Beam
    T_target_sonar: np.ndarray
    is_moving: bool

    @property
    def signed_stamp(self) -> float:
        """Seconds at which the ping left, negative while the vehicle was still (thesis 4.5.1)."""
        seconds = self.beam.stamp_ns * 1e-9
        return seconds if self.is_moving else -seconds


def servo_moved(beam: Beam, earlier: Beam) -> bool:
    """Whether the servo stands elsewhere than at an earlier beam; it may tremble."""
    return abs(beam.sensor_angle - earlier.sensor_angle) > SERVO_DEAD_BAND
