"""Parameters of autopilot_link."""

from dataclasses import dataclass
from enum import Enum

from node_support.headers import StampParameters
from node_support.parameters import parameter


class PoseMessage(Enum):
    ODOMETRY = "ODOMETRY"
    VISION_POSITION_ESTIMATE = "VISION_POSITION_ESTIMATE"


@dataclass(frozen=True)
class AutopilotLinkParameters(StampParameters):
    connection: str = parameter(
        "udpin:0.0.0.0:14550",
        "where the autopilot is: udpin:HOST:PORT (it sends to us), udpout:HOST:PORT (we send to it), a serial device "
        "or socket://HOST:PORT; empty: MAVROS runs, and takes the position from its topics",
        may_be_empty=True, tunable=False,
    )  # fmt: skip
    baud_rate: int = parameter(115200, "speed of a serial line", unit="bit/s", low=1200, tunable=False)
    system: int = parameter(
        0, "MAVLink system of the autopilot; 0: the first one that is heard", low=0, high=255, tunable=False
    )
    message: PoseMessage = parameter(
        PoseMessage.ODOMETRY, "ODOMETRY, or VISION_POSITION_ESTIMATE for autopilots that do not take it", tunable=False
    )
    rate: float = parameter(
        10.0, "most messages a second; there are no more than the odometry has poses", unit="1/s", low=1.0, high=50.0
    )
    map_azimuth_deg: float = parameter(
        90.0, "direction of the map's x axis, clockwise from north: 90 where the odometry counts x to the east",
        unit="deg", low=-360.0, high=360.0,
    )  # fmt: skip
    jump_distance: float = parameter(
        0.5, "a fix that moves the vehicle by more is a jump: the autopilot shall begin anew there and not fly to it",
        unit="m", low=0.01, high=100.0,
    )  # fmt: skip
    jump_angle_deg: float = parameter(5.0, "the same of the heading", unit="deg", low=0.1, high=180.0)
    depth_deviation: float = parameter(
        0.1, "standard deviation of the depth, which is the depth sensor's; ArduPilot makes one figure of x, y and z",
        unit="m", low=0.001, high=100.0,
    )  # fmt: skip
    tilt_deviation_deg: float = parameter(
        2.0, "standard deviation of roll and pitch, which are the odometry's", unit="deg", low=0.01, high=90.0
    )
    map_frame: str = parameter("map", "frame of the map", tunable=False)
    odom_frame: str = parameter("odom", "frame of the dead reckoning", tunable=False)
    base_frame: str = parameter("base_link", "frame of the vehicle", tunable=False)
