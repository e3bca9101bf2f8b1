"""What the messages of different sonars say of their beams. A new type needs one function here and one table entry.

The functions take any object with the fields of the message: one of rospy, of rosbags or of a test. They raise
AttributeError for a field that is missing, TypeError or ValueError for one that holds something else.
"""

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum
from typing import Any, Callable, Deque, Dict, List, Optional, Tuple, Type, Union

import numpy as np

from node_support.errors import RefusedInput
from node_support.headers import stamp_ns
from sonar_processing.beams.beam_fields import (
    BeamFields,
    TurningImage,
    length_of_bins,
    projected_sonar_image,
    raw_sonar_image,
    speed_of_sound_of,
    strengths_of,
)

_VOTES = 25  # Beams that are looked back on: more than the seven that gradians spend below 2 pi in a turn
_ROUNDING = 1e-3  # Of a float32 that holds an angle
_LASER_BINS = 500  # Bins in which the one echo of a laser ray is placed, as many as an Imagenex 852 sends
_LASER_STRENGTH = 255
_MOST_RAYS = 7200  # Rays of 0.05 deg, finer than any head steps; more is a broken message
OWN = "underwater_map_construction/SonarScanLine"
LASER_SCAN = "sensor_msgs/LaserScan"
POINT_CLOUD = "sensor_msgs/PointCloud"
IMAGE = "sensor_msgs/Image"
# Types that hold beams of a scanning sonar where somebody says so, and else what cameras and rangefinders send.
UNLIKELY = (IMAGE, LASER_SCAN)
_STRAIGHT = 0.01  # Of a bin: so far points of one beam lie beside their line, by rounding


class AngleUnit(Enum):
    """TYPE, which only parameters have, stands for the unit that is documented for a type of message."""

    TYPE = "TYPE"
    RADIANS = "RADIANS"
    DEGREES = "DEGREES"
    GRADIANS = "GRADIANS"

    def to_radians(self, angle: float) -> float:
        return angle * _RADIANS[self]


_RADIANS = {AngleUnit.RADIANS: 1.0, AngleUnit.DEGREES: math.pi / 180.0, AngleUnit.GRADIANS: math.pi / 200.0}


class RadiansOrGradians:
    """Tells by the values whether a driver sends gradians where radians are documented.

    A value beyond a turn of radians, or a whole number, speaks for gradians: heads count their steps in them, and no
    step but 0 is a whole number of radians. Any other value speaks for radians. The majority of the newest 25 decides,
    so that one broken message does not.
    """

    def __init__(self) -> None:
        self._votes: Deque[bool] = deque(maxlen=_VOTES)
        self.unit: Optional[AngleUnit] = None  # None before any angle said something

    def take(self, angle: float) -> None:
        """Take one more angle; one that is 0 or not finite says nothing."""
        if math.isfinite(angle) and angle != 0.0:
            self._votes.append(angle == round(angle) or abs(angle) > 2.0 * math.pi + _ROUNDING)
            for_gradians = sum(self._votes)
            if 2 * for_gradians != len(self._votes):
                is_gradians = 2 * for_gradians > len(self._votes)
                self.unit = AngleUnit.GRADIANS if is_gradians else AngleUnit.RADIANS


def sonar_scan_line(message: Any) -> List[BeamFields]:
    """Read a SonarScanLine; raises RefusedInput when its range is not positive."""
    if not message.maxrange_meters > 0.0:
        raise RefusedInput(
            "beams refused", f"maxrange_meters {message.maxrange_meters}, must be above 0 m; check the driver"
        )
    strengths, tilt = strengths_of(message.intensities), message.sensorAngle
    return [BeamFields.of(message, message.angle, strengths, message.range_resolution, sensor_angle=tilt)]


def sonar_echo(message: Any) -> List[BeamFields]:
    """Read a SonarEcho of ping360_sonar: `range` metres in `number_of_samples` bins."""
    strengths = strengths_of(message.intensities)
    resolution = message.range / max(message.number_of_samples or strengths.size, 1)
    speed = speed_of_sound_of(message.speed_of_sound)
    return [BeamFields.of(message, message.angle, strengths, resolution, speed_of_sound=speed)]


def sonar_ping_360(message: Any) -> List[BeamFields]:
    """Read a SonarPing360 of bluerobotics_sonar: `range` metres in the bins of `profile_data`."""
    strengths = strengths_of(message.profile_data)
    return [BeamFields.of(message, message.angle, strengths, message.range / max(strengths.size, 1))]


def scan_line(message: Any) -> List[BeamFields]:
    """Read a ScanLine of micron_driver_ros; a bin ends at its `distance`."""
    strengths = strengths_of([one.intensity for one in message.bins])
    return [BeamFields.of(message, message.angle, strengths, message.bin_distance_step)]


def point_cloud(message: Any) -> List[BeamFields]:
    """Read a PointCloud of tritech_micron: one beam, whose bin i ends at its point i.

    Raises RefusedInput for points that are not those of one beam.
    """
    points = np.array([(one.x, one.y, one.z) for one in message.points], dtype=np.float64).reshape(-1, 3)
    strengths = message.channels[0].values if message.channels else ()
    if len(points) < 2 or len(strengths) != len(points):
        raise RefusedInput("beams refused", f"{len(points)} points with {len(strengths)} strengths; must be one beam")
    step = points[-1] / len(points)
    off = np.abs(points - step * np.arange(1, len(points) + 1)[:, np.newaxis]).max()
    resolution = float(np.linalg.norm(step))
    if not off <= _STRAIGHT * resolution:
        raise RefusedInput("beams refused", f"points lie {off:.2g} m beside equal steps on a line; must be one beam")
    return [BeamFields.of(message, math.atan2(step[1], step[0]), strengths_of(strengths), resolution)]


def laser_scan(message: Any) -> List[BeamFields]:
    """Read a LaserScan: one beam with one echo for each ray; raises RefusedInput for one without range or direction.

    Rays are timed as `time_increment` says. A ray without a range becomes a beam without echoes. Rays that all point
    one way are the bins of one beam, whose strengths are their intensities, as in the Girona caves data set.
    """
    if len(message.ranges) > 1 and message.angle_increment == 0.0:
        resolution = length_of_bins(message.ranges, len(message.intensities))
        strengths = strengths_of(np.clip(message.intensities, 0, 255))
        return [BeamFields.of(message, message.angle_min, strengths, resolution)]
    if not (message.range_max > 0.0 and np.isfinite([message.range_max, message.time_increment]).all()):
        given = f"range_max {message.range_max} m, time_increment {message.time_increment} s"
        raise RefusedInput("beams refused", f"{given}; must be finite, range_max above 0")
    ranges = np.asarray(message.ranges, dtype=np.float64)
    if ranges.size > _MOST_RAYS:
        raise RefusedInput("beams refused", f"{ranges.size} rays, must be at most {_MOST_RAYS}; check the driver")
    first, resolution = stamp_ns(message.header), message.range_max / _LASER_BINS
    stamps = [first + round(1e9 * message.time_increment * ray) for ray in range(ranges.size)]
    angles = message.angle_min + np.arange(ranges.size) * message.angle_increment
    return [
        BeamFields(stamp, message.header.frame_id, float(angle), _echo_at(distance / resolution), resolution)
        for stamp, angle, distance in zip(stamps, angles, ranges)
    ]


def _echo_at(index: float) -> np.ndarray:
    strengths = np.zeros(_LASER_BINS, dtype=np.uint8)
    if 0.0 <= index < _LASER_BINS:
        strengths[int(index)] = _LASER_STRENGTH
    return strengths


@dataclass(frozen=True)
class BeamType:
    """One type of message.

    names: package/Type, in ROS 1 and ROS 2. read: takes its fields, or makes what does, message after message. unit:
    of the angle as documented. may_be_gradians: some drivers send gradians nevertheless. clockwise: whether angles grow
    clockwise seen from the tip of +z of the message's frame, as the package's own scan or cloud has it. ahead: the
    angle that points along +x of the frame, in `unit`. stamped_after_reply: the stamp was taken when the reply had
    come. advice: to who uses it. docs/sonars.md says where 0 is, what the bins are, and the source of all.
    """

    names: Tuple[str, ...]
    read: Union[Callable[[Any], List[BeamFields]], Type[TurningImage]]
    unit: AngleUnit
    may_be_gradians: bool = False
    clockwise: bool = False
    ahead: float = 0.0
    stamped_after_reply: bool = True
    advice: str = ""

    def reader(self, image_range: float) -> Callable[[Any], List[BeamFields]]:
        """Return what takes the fields of the messages of one topic. image_range: m, of images."""
        return self.read(image_range) if isinstance(self.read, type) else self.read


_TYPES: Tuple[BeamType, ...] = (
    BeamType((OWN, "avora_msgs/SonarScanLine"), sonar_scan_line, AngleUnit.RADIANS, stamped_after_reply=False),
    BeamType(
        ("ping360_sonar/SonarEcho", "ping360_sonar_msgs/SonarEcho"), sonar_echo, AngleUnit.RADIANS, may_be_gradians=True
    ),
    BeamType(
        ("bluerobotics_sonar_msgs/SonarPing360",), sonar_ping_360, AngleUnit.GRADIANS, clockwise=True, ahead=200.0
    ),
    BeamType(("micron_driver_ros/ScanLine",), scan_line, AngleUnit.DEGREES),
    BeamType((POINT_CLOUD,), point_cloud, AngleUnit.RADIANS),
    BeamType(
        ("marine_acoustic_msgs/RawSonarImage", "acoustic_msgs/RawSonarImage"), raw_sonar_image, AngleUnit.RADIANS,
        stamped_after_reply=False,
    ),
    BeamType(
        ("marine_acoustic_msgs/ProjectedSonarImage", "acoustic_msgs/ProjectedSonarImage"), projected_sonar_image,
        AngleUnit.RADIANS, stamped_after_reply=False,
    ),
    BeamType((IMAGE,), TurningImage, AngleUnit.RADIANS, clockwise=True, ahead=math.pi, stamped_after_reply=False),
    BeamType(
        (LASER_SCAN,), laser_scan, AngleUnit.RADIANS, stamped_after_reply=False,
        advice="its rays are placed at the times that time_increment says; drivers of sonars often stamp the end of a "
        "turn and give no true time_increment, and then the vehicle's motion is undone wrongly",
    ),
)  # fmt: skip

BEAM_TYPES: Dict[str, BeamType] = {name: kind for kind in _TYPES for name in kind.names}
"""By every name that a type has in ROS 1."""
