"""The path of the vehicle during a scan, as a function of a pose and of what may be wrong with the odometry.

With O(t) the odometry, t_r the reference time and tau = t - t_r, the state is

    theta = [x, y, yaw,  rate_x, rate_y, rate_yaw,  scale, direction].

x y yaw are T_map_base at t_r. The odometry's displacements are taken (1 + scale) times as long and turned by
`direction`; to its body velocity comes the constant `rate`; and because displacements were summed along the
odometry's heading, an error of the yaw rate turns them too:

    yaw(t) = yaw + phi(t) + rate_yaw tau
    position(t) = position - R(yaw) integral from t to t_r of
                  R(rate_yaw s) [(1 + scale) R(direction) d'(s) + R(phi(s)) rate_xy] ds

where phi and d are the heading and the position of O(t) as seen from O(t_r). For an odometry that reports nothing
this is pose(t) = pose exp(t twist).
"""

from typing import Tuple

import numpy as np

from mlsm_manager.scan_matching.scan import Scan
from node_support.geometry import rotated, seen_from

X, Y, YAW, RATE_X, RATE_Y, RATE_YAW, SCALE, DIRECTION = range(8)
STATES = 8
POSITION = slice(X, YAW)  # x y [m] of base_link in map at the reference time
POSE = slice(X, RATE_X)  # position and yaw [rad]: T_map_base at the reference time
RATE_XY = slice(RATE_X, RATE_YAW)  # error of the odometry's speed in the vehicle's frame, m/s
RATE = slice(RATE_X, SCALE)  # the same and the error of its turn rate, rad/s
MOTION = slice(SCALE, STATES)  # relative error of the odometry's distances, and error of their direction [rad]
ERRORS = slice(RATE_X, STATES)  # all errors of the odometry
_LEAST_NODES = 33  # two a second in a turn of 16 s, where a scan has fewer echoes than that


class PlanarMotion:
    """Places the points of one scan in the map for any state.

    beam_times: (b,) s, increasing, the last one the reference time. local: (n, 2) points in base_link at their own
    time. beam: (n,) index of each point's time in beam_times.
    """

    def __init__(self, scan: Scan, bearing_deviation: float = 0.0) -> None:
        """`bearing_deviation`: rad, standard deviation of an echo's bearing within its beam."""
        steady = np.linspace(scan.start, scan.reference_time, _LEAST_NODES)
        times = np.unique(np.append(scan.times, steady))
        self.beam_times = times[times <= scan.reference_time]
        self.beam = np.minimum(np.searchsorted(self.beam_times, scan.times), len(self.beam_times) - 1)
        odometry = scan.track.at(self.beam_times)
        poses = odometry[self.beam]
        self.local = rotated(scan.points[:, :2] - poses[:, :2], -poses[:, 2])
        self._tau = self.beam_times - scan.reference_time
        relative = seen_from(odometry[-1], odometry)
        self._heading = relative[:, 2]
        self._step = np.diff(relative[:, :2], axis=0)
        self._seconds = np.diff(self.beam_times)
        self._bearing_deviation = bearing_deviation
        self._velocity = scan.track.velocity_at(scan.reference_time)

    def path(self, theta: np.ndarray) -> np.ndarray:
        """Return T_map_base (b, 3) at the beam times."""
        turn, by_odometry, by_rate = self._steps(theta)
        offsets = _sum_to_end(rotated(by_odometry + by_rate, turn))
        position = theta[POSITION] + rotated(offsets, theta[YAW])
        return np.column_stack([position, theta[YAW] + self._heading + theta[RATE_YAW] * self._tau])

    def jacobian(self, theta: np.ndarray) -> np.ndarray:
        """Return the derivative (b, 3, 8) of `path`."""
        turn, by_odometry, by_rate = self._steps(theta)
        middle = (self._tau[1:] + self._tau[:-1]) / 2.0
        steps = rotated(by_odometry + by_rate, turn)
        heading = turn + self._middle_heading()
        along = self._seconds[:, np.newaxis] * np.column_stack([np.cos(heading), np.sin(heading)])
        scaled = rotated(self._step, turn + theta[DIRECTION])
        changes = {
            YAW: steps,
            RATE_X: along,
            RATE_Y: _quarter_turn(along),
            RATE_YAW: middle[:, np.newaxis] * _quarter_turn(steps),
            SCALE: scaled,
            DIRECTION: (1.0 + theta[SCALE]) * _quarter_turn(scaled),
        }
        result = np.zeros((len(self.beam_times), 3, STATES))
        moves = rotated(_sum_to_end(np.array([*changes.values()])), theta[YAW])
        result[:, POSITION, [*changes]] = moves.transpose(1, 2, 0)
        result[:, POSITION, YAW] = _quarter_turn(result[:, POSITION, YAW])
        result[:, X, X] = result[:, Y, Y] = result[:, YAW, YAW] = 1.0
        result[:, YAW, RATE_YAW] = self._tau
        return result

    def points(self, path: np.ndarray) -> np.ndarray:
        """Return the points (n, 2) in map for a `path` (b, 3)."""
        poses = path[self.beam]
        return poses[:, :2] + rotated(self.local, poses[:, 2])

    def arms(self, points: np.ndarray, path: np.ndarray) -> np.ndarray:
        """Return (n, 2) m in map: from the vehicle, as it was then, to each of the `points` (n, 2)."""
        return points - path[self.beam, :2]

    def point_jacobian(self, arms: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return the derivative (n, 2, 8) of `points` by the state; `arms` are those of `theta`."""
        jacobian = self.jacobian(theta)
        across = _quarter_turn(arms)
        return jacobian[self.beam, POSITION] + across[:, :, np.newaxis] * jacobian[self.beam, YAW][:, np.newaxis, :]

    def gradient_of(self, force: np.ndarray, arms: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return the (8,) sum over the points of `force` (n, 2) times the derivative of their places by the state.

        arms: (n, 2) m from the vehicle to each point, in map.
        """
        torque = arms[:, 0] * force[:, 1] - arms[:, 1] * force[:, 0]
        along = (force[:, 0], force[:, 1], torque)
        per_beam = np.stack([np.bincount(self.beam, part, len(self.beam_times)) for part in along], axis=1)
        return np.tensordot(per_beam, self.jacobian(theta), axes=([0, 1], [0, 1]))

    def point_covariance(self, arms: np.ndarray) -> np.ndarray:
        """Return (n, 2, 2) m^2 in map: what a beam's width leaves open of the bearing of points at `arms` (n, 2)."""
        sideways = _quarter_turn(arms) * self._bearing_deviation
        return sideways[:, :, np.newaxis] * sideways[:, np.newaxis, :]

    def velocity(self, theta: np.ndarray) -> np.ndarray:
        """Return the (3,) body velocity at the reference time."""
        linear = (1.0 + theta[SCALE]) * rotated(self._velocity[:2], theta[DIRECTION]) + theta[RATE_XY]
        return np.append(linear, self._velocity[2] + theta[RATE_YAW])

    def velocity_jacobian(self, theta: np.ndarray) -> np.ndarray:
        """Return the derivative (3, 8) of `velocity`."""
        result = np.zeros((3, STATES))
        result[:, RATE] = np.eye(3)
        turned = rotated(self._velocity[:2], theta[DIRECTION])
        result[POSITION, SCALE] = turned
        result[POSITION, DIRECTION] = (1.0 + theta[SCALE]) * _quarter_turn(turned)
        return result

    def _steps(self, theta: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        turn = theta[RATE_YAW] * (self._tau[1:] + self._tau[:-1]) / 2.0
        by_odometry = (1.0 + theta[SCALE]) * rotated(self._step, theta[DIRECTION])
        by_rate = self._seconds[:, np.newaxis] * rotated(theta[RATE_XY], self._middle_heading())
        return turn, by_odometry, by_rate

    def _middle_heading(self) -> np.ndarray:
        return (self._heading[1:] + self._heading[:-1]) / 2.0


def _sum_to_end(steps: np.ndarray) -> np.ndarray:
    """Return (..., b, 2): minus the sum of the steps (..., b - 1, 2) from each node to the last one."""
    result = np.zeros((*steps.shape[:-2], steps.shape[-2] + 1, 2))
    result[..., :-1, :] = -np.cumsum(steps[..., ::-1, :], axis=-2)[..., ::-1, :]
    return result


def _quarter_turn(vectors: np.ndarray) -> np.ndarray:
    result = np.empty(np.shape(vectors))
    result[..., 0] = -vectors[..., 1]
    result[..., 1] = vectors[..., 0]
    return result
