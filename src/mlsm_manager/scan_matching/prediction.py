"""Carries what is known of pose and odometry errors from scan to scan (an extended Kalman filter's prediction)."""

import math
from dataclasses import dataclass
from typing import Tuple

import numpy as np

from mlsm_manager.scan_matching.scan import Belief, Track
from mlsm_manager.scan_matching.scan_path import (
    DIRECTION,
    ERRORS,
    MOTION,
    POSE,
    POSITION,
    RATE,
    RATE_X,
    RATE_XY,
    RATE_Y,
    RATE_YAW,
    SCALE,
    STATES,
    YAW,
    X,
    Y,
)
from node_support.geometry import rotated, seen_from, wrapped
from node_support.parameters import ParameterSet, parameter

_NODES = 17  # times at which the odometry is read between two scans, about one a second
_DIFFERENCE = 1e-6  # of each state: small against a bend of the path, large against rounding


@dataclass(frozen=True)
class OdometryErrors(ParameterSet):
    """Errors of the odometry: standard deviations and correlation times."""

    scale_deviation: float = parameter(
        0.01, "standard deviation of the relative error of the distances that the odometry reports", low=0.0, high=2.0,
        tunable=False,
    )  # fmt: skip
    direction_deviation: float = parameter(
        0.1,
        "standard deviation of the error of the direction of the reported motion, as from a sensor's mounting angle",
        unit="rad", low=0.0, high=1.0, tunable=False,
    )  # fmt: skip
    speed_deviation: float = parameter(
        0.025, "standard deviation of an error of the speed that does not grow with it, as from a current",
        unit="m/s", low=0.0, high=5.0, tunable=False,
    )  # fmt: skip
    turn_rate_deviation: float = parameter(
        7e-5, "standard deviation of the error of the turn rate", unit="rad/s", low=0.0, high=1.0, tunable=False
    )
    rate_correlation_time: float = parameter(
        12.0, "correlation time of the errors of speed and turn rate", unit="s", low=0.1, high=1e6, tunable=False,
        expert="as long the noise of a DVL's velocities lasts",
    )  # fmt: skip
    motion_correlation_time: float = parameter(
        10000.0, "correlation time of the errors of scale and direction", unit="s", low=0.1, high=1e9, tunable=False,
        expert="scale and mounting hardly change during a mission",
    )  # fmt: skip
    heading_deviation: float = parameter(
        0.0175, "standard deviation of a heading that comes from a compass; 0: no compass, the heading drifts",
        unit="rad", low=0.0, high=1.0, tunable=False,
    )  # fmt: skip

    def covariance(self) -> np.ndarray:
        """Return (8, 8) of [pose, rate, motion] where the pose is known and nothing of the odometry's errors."""
        deviations = np.zeros(STATES)
        deviations[RATE] = self.speed_deviation, self.speed_deviation, self.turn_rate_deviation
        deviations[MOTION] = self.scale_deviation, self.direction_deviation
        return np.diag(deviations**2)


def predicted(belief: Belief, track: Track, time: float, errors: OdometryErrors) -> Belief:
    """Return the belief at a later `time`: the pose follows the odometry and its errors, the errors fade."""
    theta = _advanced(belief.theta, belief.time, track, time)
    jacobian = np.eye(STATES)
    for state in range(STATES):
        change = np.zeros(STATES)
        change[state] = _DIFFERENCE
        moved = _advanced(belief.theta + change, belief.time, track, time)
        jacobian[POSE, state] = (moved - theta)[POSE] / _DIFFERENCE
    lasting = np.ones(STATES)
    lasting[RATE] = np.exp(-(time - belief.time) / errors.rate_correlation_time)
    lasting[MOTION] = np.exp(-(time - belief.time) / errors.motion_correlation_time)
    transition = lasting[:, np.newaxis] * jacobian
    fresh = errors.covariance() * (1.0 - lasting**2)
    return Belief(time, lasting * theta, transition @ belief.covariance @ transition.T + fresh)


def carried_on(belief: Belief, then: np.ndarray, now: np.ndarray, time: float, errors: OdometryErrors) -> Belief:
    """Return the belief at a later `time`, when the odometry said T_odom_base `then` (3,) at its own and `now` (3,)."""
    return predicted(belief, Track(np.array([belief.time, time]), np.array([then, now])), time, errors)


def updated_by_heading(belief: Belief, heading: float, deviation: float) -> Belief:
    """Return the belief after a compass said `heading` [rad] with standard `deviation`; 0 stands for no compass."""
    if deviation == 0.0:
        return belief
    gain = belief.covariance[:, YAW] / (belief.covariance[YAW, YAW] + deviation**2)
    theta = belief.theta + gain * float(wrapped(heading - belief.theta[YAW]))
    return Belief(belief.time, theta, belief.covariance - np.outer(gain, belief.covariance[YAW]))


def advanced_path(theta: np.ndarray, start: float, track: Track, times: np.ndarray) -> np.ndarray:
    """Return T_map_base (m, 3) at increasing `times` (m,), none before `start`, where the state is `theta` (8,)."""
    nodes = np.append(start, times)
    poses = track.at(nodes)
    relative = seen_from(poses[0], poses)
    middle = (nodes[1:] + nodes[:-1]) / 2.0 - start
    heading = (relative[1:, 2] + relative[:-1, 2]) / 2.0
    steps = (1.0 + theta[SCALE]) * rotated(np.diff(relative[:, :2], axis=0), theta[DIRECTION])
    steps = steps + np.diff(nodes)[:, np.newaxis] * rotated(np.broadcast_to(theta[RATE_XY], (len(times), 2)), heading)
    shifts = np.cumsum(rotated(steps, theta[RATE_YAW] * middle), axis=0)
    position = theta[POSITION] + rotated(shifts, theta[YAW])
    return np.column_stack([position, theta[YAW] + relative[1:, 2] + theta[RATE_YAW] * (times - start)])


def advanced(theta: np.ndarray, seconds: float, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return T_map_base (3,) after one short step of the odometry from `before` to `after` (3,); see advanced_path.

    The same in plain numbers, which is faster for a single message of the odometry.
    """
    turned = math.remainder(after[2] - before[2], math.tau)
    step_x, step_y = _turned(after[0] - before[0], after[1] - before[1], theta[DIRECTION] - before[2])
    rate_x, rate_y = _turned(theta[RATE_X], theta[RATE_Y], turned / 2.0)
    along = (1.0 + theta[SCALE]) * step_x + seconds * rate_x
    aside = (1.0 + theta[SCALE]) * step_y + seconds * rate_y
    x, y = _turned(along, aside, theta[YAW] + theta[RATE_YAW] * seconds / 2.0)
    return np.array([theta[X] + x, theta[Y] + y, theta[YAW] + turned + theta[RATE_YAW] * seconds])


def _turned(x: float, y: float, angle: float) -> Tuple[float, float]:
    cos, sin = math.cos(angle), math.sin(angle)
    return cos * x - sin * y, sin * x + cos * y


def _advanced(theta: np.ndarray, start: float, track: Track, end: float) -> np.ndarray:
    times = np.linspace(start, end, _NODES)[1:]
    return np.concatenate([advanced_path(theta, start, track, times)[-1], theta[ERRORS]])
