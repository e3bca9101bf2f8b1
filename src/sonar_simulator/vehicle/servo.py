"""The servo that tilts the sonar: it turns towards the last command at a limited speed."""

import math
from dataclasses import dataclass

import numpy as np

from node_support.errors import RefusedInput
from node_support.geometry import pose_matrix
from node_support.parameters import ParameterError, ParameterSet, parameter


@dataclass(frozen=True)
class ServoParameters(ParameterSet):
    """Speed and range of the servo."""

    speed_deg: float = parameter(60.0, "speed of the servo", unit="deg/s", low=0.001, high=10000.0, tunable=False)
    lowest_deg: float = parameter(
        -90.0, "end of its range, with the sonar looking up", unit="deg", low=-180.0, high=0.0, tunable=False
    )
    highest_deg: float = parameter(
        90.0, "end of its range, with the sonar looking down", unit="deg", low=0.0, high=180.0, tunable=False
    )

    def check(self) -> None:
        """Refuse a servo that cannot turn."""
        if self.lowest_deg == self.highest_deg:
            raise ParameterError(f"lowest_deg = {self.lowest_deg}: must be below highest_deg = {self.highest_deg}")


class Servo:
    """Stays at 0 until the first command. Angles are rad about the sonar's +y: positive tilts its +x downwards."""

    def __init__(self, parameters: ServoParameters) -> None:
        self._speed = math.radians(parameters.speed_deg)
        self._lowest = math.radians(parameters.lowest_deg)
        self._highest = math.radians(parameters.highest_deg)
        self._angle = 0.0
        self._time = 0.0
        self._goal = 0.0

    def command(self, angle: float) -> None:
        """Turn towards `angle` [rad], at most to the end of the range; raises RefusedInput if it is not finite."""
        if not math.isfinite(angle):
            raise RefusedInput("servo commands refused", f"{angle} rad, must be a finite angle")
        self._goal = min(max(angle, self._lowest), self._highest)

    def angle(self, time: float) -> float:
        """Return the angle [rad] at `time` [s]; at a time before the last one, the servo is where it was last."""
        reach = self._speed * max(time - self._time, 0.0)
        self._time = max(time, self._time)
        way = self._goal - self._angle
        self._angle = self._goal if abs(way) <= reach else self._angle + math.copysign(reach, way)
        return self._angle


def tilted(T_base_sonar: np.ndarray, angle: float) -> np.ndarray:
    """Return the (4, 4) mount of a sonar whose servo is at `angle` [rad], given its mount at 0."""
    return T_base_sonar @ pose_matrix((0.0, 0.0, 0.0), (0.0, angle, 0.0))
