"""Which message types are read as beams, and what is documented of each."""

from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Tuple

from sonar_processing.messages import fields
from sonar_processing.messages.angles import AngleUnit
from sonar_processing.messages.fields import BeamFields


@dataclass(frozen=True)
class BeamType:
    """One type of message.

    names: package/Type, in ROS 1 and ROS 2. read: takes its fields. unit: of the angle as documented. may_be_gradians:
    some drivers send gradians nevertheless. clockwise: whether angles grow clockwise seen from the tip of +z of the
    message's frame, as the package's own scan or cloud has it. ahead: the angle that points along +x of the frame, in
    `unit`. stamped_after_reply: the stamp was taken when the reply had come. zero, strengths, bins and source: words
    for docs/sonars.md.
    """

    names: Tuple[str, ...]
    read: Callable[[Any], List[BeamFields]]
    unit: AngleUnit
    zero: str
    strengths: str
    bins: str
    source: str
    may_be_gradians: bool = False
    clockwise: bool = False
    ahead: float = 0.0
    stamped_after_reply: bool = True
    advice: str = ""

    @property
    def name(self) -> str:
        """The first of its names."""
        return self.names[0]


OWN = "underwater_map_construction/SonarScanLine"
LASER_SCAN = "sensor_msgs/LaserScan"

_TYPES: Tuple[BeamType, ...] = (
    BeamType(
        (OWN, "avora_msgs/SonarScanLine"), fields.sonar_scan_line, AngleUnit.RADIANS,
        zero="+x of the frame", strengths="0 to 255; an Imagenex 852 sends 0 to 127", bins="`range_resolution`",
        source="`msg/SonarScanLine.msg`", stamped_after_reply=False,
    ),
    BeamType(
        ("ping360_sonar/SonarEcho", "ping360_sonar_msgs/SonarEcho"), fields.sonar_echo, AngleUnit.RADIANS,
        zero="+x of the frame, as in the driver's LaserScan; where that is on the head is not documented",
        strengths="0 to 255", bins="`range` / `number_of_samples`", may_be_gradians=True,
        source="`SonarEcho.msg`, and `publishScan` and `rangeFrom` in CentraleNantesRobotics/ping360_sonar",
    ),
    BeamType(
        ("bluerobotics_sonar_msgs/SonarPing360",), fields.sonar_ping_360, AngleUnit.GRADIANS,
        zero="astern: the angle is the head's own, of which Ping Viewer draws 200 gradians ahead",
        strengths="0 to 255", bins="`range` / length of `profile_data`", clockwise=True, ahead=200.0,
        source="`SonarPing360.msg` and `ping360.py` in itskalvik/bluerobotics_sonar; `polarplot.cpp` of Ping Viewer",
    ),
    BeamType(
        ("micron_driver_ros/ScanLine",), fields.scan_line, AngleUnit.DEGREES,
        zero="+x of the frame, as in the package's `scan_line_parser`; where that is on the head is not documented",
        strengths="0 to 255", bins="`bin_distance_step`; bin i ends at i + 1 steps",
        source="the message has no comments; `scan_line_parser` and the driver of micron_driver_ros",
    ),
    BeamType(
        (LASER_SCAN,), fields.laser_scan, AngleUnit.RADIANS,
        zero="+x of the frame", strengths="one echo of 255 per ray", bins="`range_max` / 500",
        source="`LaserScan.msg` of sensor_msgs", stamped_after_reply=False,
        advice="its rays are placed at the times that time_increment says; drivers of sonars often stamp the end of a "
        "turn and give no true time_increment, and then the vehicle's motion is undone wrongly",
    ),
)  # fmt: skip

BEAM_TYPES: Dict[str, BeamType] = {name: kind for kind in _TYPES for name in kind.names}
"""By every name that a type has in ROS 1."""


def ros1_name(name: str) -> str:
    """Return package/Type of a type's name, which in ROS 2 is package/msg/Type."""
    return name.replace("/msg/", "/")
