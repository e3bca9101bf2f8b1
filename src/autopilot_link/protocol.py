"""What the position is for an autopilot: its axes, its clock, and where it jumps.

Ours are x ahead, y left, z up on a vehicle and z up in the map (REP-103); MAVLink's x ahead, y right, z down and north,
east, down. Messages: https://mavlink.io/en/messages/common.html; time: https://mavlink.io/en/services/timesync.html.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Deque, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from autopilot_link.parameters import AutopilotLinkParameters
from node_support.errors import RefusedInput
from node_support.geometry import pose_matrix, wrapped, yaw_of

_DOWNWARD = np.diag([1.0, -1.0, -1.0])
_R_NED_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_COVARIANCE_NED_ENU = np.block([[_R_NED_ENU, np.zeros((3, 3))], [np.zeros((3, 3)), _DOWNWARD]])
_EAST_DEG = 90.0
_UPPER = np.triu_indices(6)
_POSE_AXES = np.array([0, 1, 5])  # x, y and yaw among the six of a covariance
_LONGEST_STEP = 1.0  # s: over longer ones no velocity is known
_FASTEST = 20.0  # m/s: beyond any underwater vehicle
_CATCHING_UP_NS = 5 * 10**9  # ns: tf takes a second to come to a fix; a fix that it does not come to is gone
_WINDOW = 10  # answers of TIMESYNC that are remembered: ten seconds of them
_PENDING = 8  # requests that may still be answered
_LONGEST_TRIP_NS = 10**9  # ns: an answer that took longer tells nothing that a control loop could use
_DRIFT_NS = 5 * 10**6  # ns: of two crystals within the window, ten times what they differ by


@dataclass(frozen=True)
class StatedPose:
    """Where the vehicle is, x east, y north, z up, and along its axes ahead, left, up.

    T_enu_base: (4, 4). velocity: (3,) m/s, NaN where it is not known. covariance: (6, 6) of x, y, z and the rotations
    about them. reset_counter: 0 to 255, one more after each jump.
    """

    stamp_ns: int
    T_enu_base: np.ndarray
    velocity: np.ndarray
    covariance: np.ndarray
    reset_counter: int

    @property
    def in_ned(self) -> np.ndarray:
        """T_ned_frd (4, 4): the pose in MAVLink's axes."""
        pose = np.eye(4)
        pose[:3, :3] = _R_NED_ENU @ self.T_enu_base[:3, :3] @ _DOWNWARD
        pose[:3, 3] = _R_NED_ENU @ self.T_enu_base[:3, 3]
        return pose

    @property
    def roll_pitch_yaw(self) -> Tuple[float, float, float]:
        """Angles of `in_ned` about its x, then y, then z axis, rad."""
        matrix = self.in_ned
        roll, pitch = math.atan2(matrix[2, 1], matrix[2, 2]), -math.asin(max(-1.0, min(1.0, matrix[2, 0])))
        return roll, pitch, yaw_of(matrix)

    @property
    def velocity_frd(self) -> np.ndarray:
        """The velocity (3,) in MAVLink's axes."""
        return _DOWNWARD @ self.velocity

    @property
    def covariance_ned(self) -> np.ndarray:
        """The upper triangle (21,) of the covariance in MAVLink's axes, row by row."""
        return (_COVARIANCE_NED_ENU @ self.covariance @ _COVARIANCE_NED_ENU.T)[_UPPER]


def enu_of_map(azimuth_deg: float) -> np.ndarray:
    """Return T_enu_map (4, 4) of a map whose x axis points `azimuth_deg` clockwise from north."""
    return pose_matrix((0.0, 0.0, 0.0), (0.0, 0.0, math.radians(_EAST_DEG - azimuth_deg)))


def full_covariance(planar: np.ndarray, parameters: AutopilotLinkParameters) -> np.ndarray:
    """Return the covariance (6, 6) east, north, up for that of x, y and yaw in the map (3, 3).

    z, roll and pitch are measured by others than us: leaving them unknown would make ArduPilot, which takes one
    deviation for x, y and z together, believe nothing.
    """
    turn = enu_of_map(parameters.map_azimuth_deg)[:3, :3]
    tilt = math.radians(parameters.tilt_deviation_deg) ** 2
    full = np.diag([0.0, 0.0, parameters.depth_deviation**2, tilt, tilt, 0.0])
    full[np.ix_(_POSE_AXES, _POSE_AXES)] = turn @ planar @ turn.T
    return full


def velocity_between(T_before: np.ndarray, T_now: np.ndarray, seconds: float) -> np.ndarray:
    """Return (3,) m/s along the axes of a vehicle that went from one pose (4, 4) to the other.

    NaN, which stands for unknown, where they are too far apart in time, or in space as after a restart of the odometry.
    """
    moved = T_now[:3, 3] - T_before[:3, 3]
    if not 0.0 < seconds <= _LONGEST_STEP or np.linalg.norm(moved) > _FASTEST * seconds:
        return np.full(3, np.nan)
    return T_now[:3, :3].T @ moved / seconds


def rotation_of_attitude(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return R_enu_base (3, 3) of ATTITUDE's angles [rad]; raises RefusedInput for broken ones."""
    if not all(map(math.isfinite, (roll, pitch, yaw))):
        raise RefusedInput("attitudes refused", f"roll {roll}, pitch {pitch}, yaw {yaw} rad, must be finite")
    return _R_NED_ENU.T @ pose_matrix((0.0, 0.0, 0.0), (roll, pitch, yaw))[:3, :3] @ _DOWNWARD


def velocity_of_ned(velocity: Sequence[float], R_enu_base: np.ndarray) -> np.ndarray:
    """Return (3,) m/s along ahead, left, up for one along north, east, down; raises RefusedInput for a broken one."""
    if not all(map(math.isfinite, velocity)):
        raise RefusedInput("velocities refused", f"{tuple(velocity)} m/s, must be finite")
    return R_enu_base.T @ _R_NED_ENU.T @ np.array(velocity)


class _Answer(NamedTuple):
    offset_ns: int
    trip_ns: int


class AutopilotClock:
    """How far the autopilot's clock is ahead of ours, by TIMESYNC.

    An answer bounds the offset to half its round trip (Cristian, Probabilistic clock synchronization, 1989); the one
    with the shortest trip counts. One that contradicts it means that a clock was set, or the autopilot started anew.
    """

    def __init__(self) -> None:
        self.jumps = 0
        self._answers: Deque[_Answer] = deque(maxlen=_WINDOW)
        self._pending: Deque[int] = deque(maxlen=_PENDING)

    @property
    def offset_ns(self) -> Optional[int]:
        """The autopilot's time minus ours, ns; None before the first answer."""
        return min(self._answers, key=lambda one: one.trip_ns).offset_ns if self._answers else None

    @property
    def trip_ns(self) -> int:
        """Shortest round trip of the answers that are remembered, ns; 0 before the first."""
        return min((one.trip_ns for one in self._answers), default=0)

    def request(self, now_ns: int) -> None:
        """Learn that a request with our time was sent."""
        self._pending.append(now_ns)

    def take_answer(self, sent_ns: int, autopilot_ns: int, now_ns: int) -> None:
        """Take an answer to a request; raises RefusedInput for one that comes too late to tell the time."""
        if sent_ns not in self._pending:
            return
        self._pending.remove(sent_ns)
        trip = now_ns - sent_ns
        if not 0 <= trip <= _LONGEST_TRIP_NS:
            raise RefusedInput("answers of TIMESYNC refused", f"round trip {trip * 1e-9:.3f} s, must be 0 to 1 s")
        found = _Answer(autopilot_ns - (sent_ns + now_ns) // 2, trip)
        best = self.offset_ns
        if best is not None and abs(found.offset_ns - best) > (trip + self.trip_ns) // 2 + _DRIFT_NS:
            self._answers.clear()
            self.jumps += 1
        self._answers.append(found)


class Corrections:
    """Which map -> odom holds, and how often it jumped.

    tf moves to a new fix within a second. For an autopilot that would be a motion: it gets the fix's own map -> odom
    until tf has come near it.
    """

    def __init__(self) -> None:
        self.jumps = 0
        self._last: Optional[np.ndarray] = None
        self._fix: Optional[np.ndarray] = None
        self._fixed_ns = 0

    def take_fix(self, stamp_ns: int, T_map_odom: np.ndarray) -> None:
        """Take the correction (4, 4) of a fix that came when the newest odometry had this stamp."""
        self._fixed_ns, self._fix = stamp_ns, T_map_odom

    def corrected(
        self, stamp_ns: int, T_map_odom: np.ndarray, T_odom_base: np.ndarray, limits: AutopilotLinkParameters
    ) -> np.ndarray:
        """Return T_map_base (4, 4) of what is sent now, and count a jump; T_map_odom: as tf has it now."""
        ahead = self._fix is not None and abs(stamp_ns - self._fixed_ns) < _CATCHING_UP_NS
        if ahead and _is_far(self._fix @ T_odom_base, T_map_odom @ T_odom_base, limits, 0.5):
            T_map_odom = self._fix
        else:
            self._fix = None
        if self._last is not None and _is_far(self._last @ T_odom_base, T_map_odom @ T_odom_base, limits, 1.0):
            self.jumps += 1
        self._last = T_map_odom
        return T_map_odom @ T_odom_base


def _is_far(first: np.ndarray, second: np.ndarray, limits: AutopilotLinkParameters, share: float) -> bool:
    """Return whether two poses (4, 4) differ by more than `share` of a jump."""
    distance = float(np.linalg.norm(first[:2, 3] - second[:2, 3]))
    turn = abs(math.degrees(wrapped(yaw_of(first) - yaw_of(second))))
    return distance > share * limits.jump_distance or turn > share * limits.jump_angle_deg
