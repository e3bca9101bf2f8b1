"""A vehicle that follows velocity commands, as an operator or an autopilot sends them."""

import math
from dataclasses import dataclass

import numpy as np

from node_support.errors import RefusedInput
from node_support.geometry import pose_matrix
from node_support.parameters import ParameterSet, parameter
from sonar_simulator.simulation.scripted_vehicle import VehicleState

_STEP = 0.01  # s: short against the time in which the vehicle reaches its speed
_STILL_SPEED = 1e-3  # m/s and rad/s: slower is the tail of an exponential, and the vehicle rests


@dataclass(frozen=True)
class VehicleParameters(ParameterSet):
    """Limits of the vehicle when it is driven by commands; scripts have their own."""

    surge_speed: float = parameter(1.0, "greatest speed forward and back", unit="m/s", low=0.0, high=20.0)
    sway_speed: float = parameter(0.4, "greatest speed to either side", unit="m/s", low=0.0, high=20.0)
    heave_speed: float = parameter(0.4, "greatest speed up and down", unit="m/s", low=0.0, high=20.0)
    turn_rate_deg: float = parameter(30.0, "greatest turn rate", unit="deg/s", low=0.0, high=360.0)
    response_time: float = parameter(
        0.6, "time constant of the speed; 80 % of a new command is reached after three of them", unit="s", low=0.02,
        high=60.0,
    )  # fmt: skip
    command_timeout: float = parameter(
        0.5, "simulated time without a command after which the vehicle stops", unit="s", low=0.01, high=3600.0
    )

    def limits(self) -> np.ndarray:
        """Return (4,) the greatest surge, sway, heave [m/s] and turn rate [rad/s]."""
        return np.array([self.surge_speed, self.sway_speed, self.heave_speed, math.radians(self.turn_rate_deg)])


class CommandedVehicle:
    """Approaches the commanded velocity like a critically damped spring, so that its acceleration never jumps.

    It keeps itself level (thesis 4.3.1: trimmed, no pitch control), stays below the surface at z = 0, and stops when
    commands cease. There are no collisions: it can move through walls.
    """

    duration = math.inf

    def __init__(self, parameters: VehicleParameters, start: np.ndarray) -> None:
        """`start`: (4,) x, y, z [m] and yaw [rad] at time 0."""
        self._parameters = parameters
        self._position = np.array(start, dtype=np.float64)
        self._velocity = np.zeros(4)
        self._acceleration = np.zeros(4)
        self._wanted = np.zeros(4)
        self._commanded_until = 0.0
        self._time = 0.0

    def command(self, time: float, twist: np.ndarray) -> bool:
        """Follow a (6,) body twist from `time` s on; return whether its speed had to be limited.

        Roll and pitch rates are ignored, because the vehicle cannot control them. Raises RefusedInput if a value is not
        finite; the last command then stays valid until it times out.
        """
        if not np.isfinite(twist).all():
            raise RefusedInput("velocity commands refused", f"{twist.tolist()}: every value must be finite")
        wanted = np.asarray(twist, dtype=np.float64)[[0, 1, 2, 5]]
        limits = self._parameters.limits()
        self._wanted = np.clip(wanted, -limits, limits)
        self._commanded_until = time + self._parameters.command_timeout
        return bool((np.abs(wanted) > limits).any())

    def state(self, time: float) -> VehicleState:
        """Return the state at `time` s; the motion since the last call is integrated in steps of 10 ms."""
        steps = max(1, math.ceil((time - self._time) / _STEP))
        duration = (time - self._time) / steps
        for step in range(steps if duration > 0.0 else 0):
            self._advance(self._time + step * duration, duration)
        self._time = max(time, self._time)
        surge, sway, heave, turn_rate = self._velocity
        x, y, z, yaw = self._position
        return VehicleState(
            pose_matrix((x, y, z), (0.0, 0.0, yaw)),
            np.array([surge, sway, heave, 0.0, 0.0, turn_rate]),
            not self._velocity.any(),
        )

    def _advance(self, time: float, duration: float) -> None:
        before = self._velocity
        self._approach(self._wanted if time < self._commanded_until else np.zeros(4), duration)
        surge, sway, heave, turn_rate = 0.5 * (before + self._velocity)
        yaw = self._position[3] + 0.5 * duration * turn_rate
        cos_yaw, sin_yaw = math.cos(yaw), math.sin(yaw)
        rates = np.array([cos_yaw * surge - sin_yaw * sway, sin_yaw * surge + cos_yaw * sway, heave, turn_rate])
        self._position = self._position + duration * rates
        if self._position[2] > 0.0:
            self._position[2] = self._velocity[2] = self._acceleration[2] = 0.0

    def _approach(self, wanted: np.ndarray, duration: float) -> None:
        """Solve v'' = (wanted - v) / t^2 - 2 v' / t for constant `wanted`, exactly."""
        decay = math.exp(-duration / self._parameters.response_time)
        offset = self._velocity - wanted
        slope = self._acceleration + offset / self._parameters.response_time
        offset = (offset + slope * duration) * decay
        self._acceleration = slope * decay - offset / self._parameters.response_time
        self._velocity = wanted + offset
        if not wanted.any() and np.abs(self._velocity).max() < _STILL_SPEED:
            self._velocity = np.zeros(4)
            self._acceleration = np.zeros(4)
