"""Parameters of dead_reckoning."""

from dataclasses import dataclass
from enum import Enum

from node_support.headers import StampParameters
from node_support.parameters import parameter


class VelocitySource(Enum):
    """Where the vehicle's velocity comes from."""

    ESTIMATE = "ESTIMATE"
    COMMANDS = "COMMANDS"
    MEASURED = "MEASURED"


class HeadingType(Enum):
    """What the compass publishes."""

    IMU = "IMU"
    COMPASS_DEGREES = "COMPASS_DEGREES"
    COMPASS_RADIANS = "COMPASS_RADIANS"


class DepthType(Enum):
    """What the depth sensor publishes."""

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
