"""Adds up velocities along the heading (REP-105: the frame odom is continuous and drifts); parameters."""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Optional, Sequence

import numpy as np

from node_support.errors import RefusedInput
from node_support.geometry import rotated, wrapped, yaw_of
from node_support.headers import JUMP_BACK, StampParameters
from node_support.parameters import parameter
from node_support.timing import UsualInterval


class VelocitySource(Enum):
    ESTIMATE = "ESTIMATE"
    COMMANDS = "COMMANDS"
    MEASURED = "MEASURED"


class HeadingType(Enum):
    IMU = "IMU"
    COMPASS_DEGREES = "COMPASS_DEGREES"
    COMPASS_RADIANS = "COMPASS_RADIANS"


class DepthType(Enum):
    NONE = "NONE"
    POSE = "POSE"
    DEPTH = "DEPTH"
    ALTITUDE = "ALTITUDE"
    PRESSURE = "PRESSURE"


@dataclass(frozen=True)
class DeadReckoningParameters(StampParameters):
    """How heading, depth and velocity become odom -> base_link."""

    velocity_source: VelocitySource = parameter(
        VelocitySource.ESTIMATE,
        "ESTIMATE: what mlsm_core finds from matched scans; COMMANDS: what the thrusters are told on cmd_vel; "
        "MEASURED: what a DVL measures, on dvl",
        tunable=False,
    )
    velocity_timeout: float = parameter(
        120.0, "the vehicle is taken as still when its estimate is older", unit="s", low=0.1, high=3600.0
    )
    velocity_fading: float = parameter(
        40.0,
        "an estimate, or what was measured, falls to a third within this time once the next one is overdue; as long as "
        "the profile `heading` "
        "takes a change of speed to last", unit="s", low=0.1, high=3600.0,
    )  # fmt: skip
    command_timeout: float = parameter(
        1.0, "the vehicle is taken as still when its command is older; drivers repeat commands several times a second",
        unit="s", low=0.05, high=3600.0,
    )  # fmt: skip
    heading_type: HeadingType = parameter(
        HeadingType.IMU,
        "messages on the topic imu: IMU (sensor_msgs/Imu with an orientation), COMPASS_DEGREES or COMPASS_RADIANS "
        "(std_msgs/Float64, clockwise from north, as MAVROS's compass_hdg); with a compass the vehicle "
        "counts as level and the compass as aligned with it",
        tunable=False,
    )  # fmt: skip
    longest_gap: float = parameter(2.0, "warn when no heading comes for longer", unit="s", low=0.01, high=3600.0)
    depth_type: DepthType = parameter(
        DepthType.NONE,
        "messages on the topic depth: POSE (geometry_msgs/PoseWithCovarianceStamped, z up), DEPTH (std_msgs/Float64, m "
        "below the surface), ALTITUDE (std_msgs/Float64, m above the surface, as MAVROS's rel_alt), PRESSURE "
        "(sensor_msgs/FluidPressure); NONE: the vehicle stays at one depth",
        tunable=False,
    )  # fmt: skip
    surface_pressure: float = parameter(
        101325.0, "pressure at the surface, which depends on weather and altitude", unit="Pa", low=3e4, high=2e5
    )
    water_density: float = parameter(
        1025.0, "density of the water: 1025 in the sea, 1000 in a lake", unit="kg/m^3", low=900.0, high=1300.0
    )
    odom_frame: str = parameter("odom", "frame of the dead reckoning", tunable=False)
    base_frame: str = parameter("base_link", "frame of the vehicle", tunable=False)


GAPS = "gaps in the heading"
_REFUSED_VELOCITIES = "velocities refused"
STANDARD_GRAVITY = 9.80665  # m/s^2
_MOST_TURNS = 2.0  # a compass counts to one turn; a driver that unwraps it counts on
_DEEPEST = 11_000.0  # m: of the oceans
_FASTEST = 20.0  # m/s: beyond any underwater vehicle


@dataclass(frozen=True)
class Reckoning:
    """Where the vehicle is. T_odom_base: (4, 4). velocity: (3,) m/s in base_link. turn_rate: rad/s about odom's z.

    gap: seconds without a heading before this one, where they are more than `longest_gap`; else 0.
    """

    stamp_ns: int
    T_odom_base: np.ndarray
    velocity: np.ndarray
    turn_rate: float
    gap: float


class DeadReckoner:
    """Takes headings, depths and velocities in the order in which they come.

    The vehicle keeps its newest velocity, which is one along its own axes, until a newer one comes. Once that is
    overdue, a velocity that was estimated or measured fades: nobody knows whether the vehicle still has it. After a
    timeout the vehicle counts as still. A velocity that was measured tilts with the vehicle, the others are level.
    """

    def __init__(self, parameters: DeadReckoningParameters) -> None:
        self.parameters = parameters
        self.clear()

    def clear(self) -> None:
        self._position = np.zeros(3)
        self._stamp_ns: Optional[int] = None
        self._yaw = 0.0
        self._velocity, self._instrument = np.zeros(3), np.zeros(2)
        self._velocity_stamp_ns: Optional[int] = None
        self._velocities = UsualInterval()

    def take_velocity(self, stamp_ns: int, velocity: np.ndarray, instrument: Sequence[float] = (0.0, 0.0)) -> None:
        """Take a velocity (3,) [m/s] along base_link's axes, of the place x y [m] in base_link where it was measured.

        Raises RefusedInput for one that no vehicle has.
        """
        if not np.abs(velocity).max() <= _FASTEST:
            raise RefusedInput(_REFUSED_VELOCITIES, f"{velocity} m/s, must be finite and at most {_FASTEST:g} m/s")
        self._velocity = np.array(velocity, dtype=np.float64)
        self._instrument = np.array(instrument, dtype=np.float64)
        self._velocity_stamp_ns = stamp_ns
        self._velocities.take(stamp_ns * 1e-9)

    def take_depth(self, depth: float) -> None:
        """Take a depth [m] below the surface. Raises RefusedInput for one that no sea has."""
        if not abs(depth) <= _DEEPEST:
            raise RefusedInput("depths refused", f"{depth} m, must be finite and at most {_DEEPEST:g} m")
        self._position[2] = -depth

    def take_orientation(self, stamp_ns: int, rotation: np.ndarray) -> Reckoning:
        """Take the vehicle's orientation R_odom_base (3, 3) and return where the vehicle is then.

        Raises RefusedInput for one that is not newer than the last.
        """
        if self._stamp_ns is not None and stamp_ns < self._stamp_ns - JUMP_BACK * 1e9:
            self.clear()
        if self._stamp_ns is not None and stamp_ns <= self._stamp_ns:
            raise RefusedInput("old headings", f"{stamp_ns * 1e-9:.3f} s is not newer than the last")
        yaw = yaw_of(rotation)
        elapsed = 0.0 if self._stamp_ns is None else (stamp_ns - self._stamp_ns) * 1e-9
        turn = wrapped(yaw - self._yaw) if elapsed else 0.0
        turn_rate = turn / elapsed if elapsed else 0.0
        velocity = self._velocity_at(stamp_ns, turn_rate)
        level = velocity[:2]
        if self.parameters.velocity_source is VelocitySource.MEASURED:
            level = rotated((rotation @ velocity)[:2], -yaw)
        self._position[:2] += elapsed * rotated(level, yaw - turn / 2.0)
        self._stamp_ns, self._yaw = stamp_ns, yaw
        T_odom_base = np.eye(4)
        T_odom_base[:3, :3], T_odom_base[:3, 3] = rotation[:3, :3], self._position
        gap = elapsed if elapsed > self.parameters.longest_gap else 0.0
        return Reckoning(stamp_ns, T_odom_base, velocity, turn_rate, gap)

    def _velocity_at(self, stamp_ns: int, turn_rate: float) -> np.ndarray:
        own = self.parameters
        if self._velocity_stamp_ns is None:
            return np.zeros(3)
        commanded = own.velocity_source is VelocitySource.COMMANDS
        age = (stamp_ns - self._velocity_stamp_ns) * 1e-9
        if math.fabs(age) > (own.command_timeout if commanded else own.velocity_timeout):
            return np.zeros(3)
        overdue = 0.0 if commanded else self._velocities.overdue(stamp_ns * 1e-9)
        x, y = self._instrument
        return math.exp(-overdue / own.velocity_fading) * (self._velocity + turn_rate * np.array([y, -x, 0.0]))


def depth_of_pressure(pressure: float, surface_pressure: float, density: float) -> float:
    """Return the depth [m] below the surface where the water's absolute pressure is `pressure` [Pa].

    density: of the water, kg/m^3, taken to be the same at all depths.
    """
    return (pressure - surface_pressure) / (density * STANDARD_GRAVITY)


def rotation_of_heading(heading: float, kind: HeadingType) -> np.ndarray:
    """Return R_odom_base (3, 3), x east and z up, of a level vehicle.

    heading: clockwise from north, in degrees or radians as `kind` says.
    Raises RefusedInput for a heading that is not finite, or of more than two turns.
    """
    radians = math.radians(heading) if kind is HeadingType.COMPASS_DEGREES else heading
    if not abs(radians) <= _MOST_TURNS * 2.0 * math.pi:
        unit = "deg" if kind is HeadingType.COMPASS_DEGREES else "rad"
        raise RefusedInput("headings refused", f"{heading} {unit}, must be finite, at most two turns; see heading_type")
    yaw = math.pi / 2.0 - radians
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
