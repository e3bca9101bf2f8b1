"""The vehicle's own estimate of its motion (thesis 7.4)."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from node_support.geometry import pose_matrix, rotated, wrapped, yaw_of
from node_support.parameters import ParameterSet, parameter
from sonar_simulator.simulation.scripted_vehicle import VehicleState

_NOISE_TIME = 1.0  # s: correlation time, about that of a vehicle's own dynamics


@dataclass(frozen=True)
class OdometryParameters(ParameterSet):
    """The errors of the odometry. Depth has none, because it comes from a pressure sensor (thesis 4.3.2)."""

    scale_error: float = parameter(0.02, "true distances are 1 + scale_error times the odometry's", low=-0.9, high=10.0)
    heading_drift_deg_per_minute: float = parameter(
        0.0, "the odometry's heading drifts from the true one at this rate", unit="deg/min", low=-360.0, high=360.0
    )
    speed_noise: float = parameter(
        0.0, "standard deviation of the measured speed along each axis, as a share of the speed", low=0.0, high=10.0
    )
    turn_rate_noise_deg: float = parameter(
        0.0, "standard deviation of the measured turn rate while the vehicle moves", unit="deg/s", low=0.0, high=360.0
    )


class Estimate(NamedTuple):
    """The odometry's estimate: (4, 4) T_odom_base and the (6,) body twist, m/s and rad/s."""

    T_odom_base: np.ndarray
    twist: np.ndarray


class NoOdometry:
    """What a vehicle that measures nothing knows: it stays where it starts, at x = y = 0."""

    def __init__(self, start: np.ndarray) -> None:
        """`start`: (4, 4) T_world_base at time 0."""
        self._pose = start.copy()
        self._pose[:2, 3] = 0.0

    def estimate(self, time: float, state: VehicleState) -> Estimate:
        return Estimate(self._pose, np.zeros(6))


class Odometry:
    """Dead reckoning from a speed and a turn rate measured with errors. At the start, odom is the world frame.

    Noise is a Gauss-Markov process with a correlation time of 1 s, so that its effect on the pose does not depend
    on how often the odometry is evaluated. A vehicle at rest is measured to be at rest, except for its heading drift.
    """

    def __init__(self, parameters: OdometryParameters, start: np.ndarray, rng: np.random.Generator) -> None:
        """`start`: (4, 4) T_world_base at time 0, when the odometry is exact."""
        self._parameters = parameters
        self._rng = rng
        self._time = 0.0
        self._true = start
        self._position = start[:2, 3].copy()
        self._heading_error = 0.0
        self._noise = rng.standard_normal(3)

    def estimate(self, time: float, state: VehicleState) -> Estimate:
        """Return the estimate at `time` s, which must not be before that of the last call, for the true `state`."""
        duration = max(time - self._time, 0.0)
        self._advance(duration, state)
        self._time = max(time, self._time)
        x, y = self._position
        yaw = yaw_of(state.T_world_base) + self._heading_error
        pose = pose_matrix((x, y, state.T_world_base[2, 3]), (0.0, 0.0, yaw))
        return Estimate(pose, self._measured(state))

    def _advance(self, duration: float, state: VehicleState) -> None:
        keep = math.exp(-duration / _NOISE_TIME)
        self._noise = keep * self._noise + math.sqrt(1.0 - keep**2) * self._rng.standard_normal(3)
        turned = self._turn_rate_error(state) * duration
        yaw = yaw_of(state.T_world_base)
        before = yaw_of(self._true)
        middle = 0.5 * (before + (before + wrapped(yaw - before)))
        moved = rotated(state.T_world_base[:2, 3] - self._true[:2, 3], -middle)
        measured = moved * self._scale * (1.0 + self._parameters.speed_noise * self._noise[:2])
        self._position = self._position + rotated(measured, middle + self._heading_error + 0.5 * turned)
        self._heading_error += turned
        self._true = state.T_world_base

    def _measured(self, state: VehicleState) -> np.ndarray:
        twist = state.twist.copy()
        twist[:2] *= self._scale * (1.0 + self._parameters.speed_noise * self._noise[:2])
        if not state.is_still:
            twist[5] += self._turn_rate_error(state)
        return twist

    def _turn_rate_error(self, state: VehicleState) -> float:
        drift = self._parameters.heading_drift_deg_per_minute / 60.0
        noise = 0.0 if state.is_still else self._parameters.turn_rate_noise_deg * self._noise[2]
        return math.radians(drift + noise)

    @property
    def _scale(self) -> float:
        return 1.0 / (1.0 + self._parameters.scale_error)
