"""What the messages of different sonars say of their beams. A new type needs one function here and one table entry.

The functions take any object with the fields of the message: one of rospy, of rosbags or of a test. They raise
AttributeError for a field that is missing, TypeError or ValueError for one that holds something else.
"""

from dataclasses import dataclass
from typing import Any, List, Sequence, Union

import numpy as np

from node_support.errors import RefusedInput

USUAL_SPEED_OF_SOUND = 1500.0  # m/s, what drivers assume where a message does not say
_SLOWEST, _FASTEST = 1300.0, 1700.0  # m/s, of any water; a message with another value was not filled in
_LASER_BINS = 500  # Bins in which the one echo of a laser ray is placed, as many as an Imagenex 852 sends
_LASER_STRENGTH = 255
_MOST_RAYS = 7200  # Rays of 0.05 deg, finer than any head steps; more is a broken message


@dataclass(frozen=True)
class BeamFields:
    """One beam as its message has it.

    stamp_ns: of the header, ns. angle: of the head, in the unit and direction of the message. intensities: (bins,)
    uint8. range_resolution: length of a bin, m. sensor_angle: tilt of the servo, rad. speed_of_sound: m/s.
    """

    stamp_ns: int
    frame_id: str
    angle: float
    intensities: np.ndarray
    range_resolution: float
    sensor_angle: float = 0.0
    speed_of_sound: float = USUAL_SPEED_OF_SOUND

    @property
    def travel_time_ns(self) -> int:
        """How long the sound takes to the last bin and back, ns."""
        return round(2e9 * self.intensities.size * self.range_resolution / self.speed_of_sound)


def sonar_scan_line(message: Any) -> List[BeamFields]:
    """Read a SonarScanLine; raises RefusedInput when its range is not positive."""
    if not message.maxrange_meters > 0.0:
        raise RefusedInput("beams refused", f"maxrange_meters {message.maxrange_meters}, must be above 0 m")
    return [
        BeamFields(
            stamp_ns(message.header),
            message.header.frame_id,
            message.angle,
            _strengths(message.intensities),
            message.range_resolution,
            message.sensorAngle,
        )
    ]


def sonar_echo(message: Any) -> List[BeamFields]:
    """Read a SonarEcho of ping360_sonar: `range` metres in `number_of_samples` bins."""
    strengths = _strengths(message.intensities)
    bins = message.number_of_samples or strengths.size
    return [
        BeamFields(
            stamp_ns(message.header),
            message.header.frame_id,
            message.angle,
            strengths,
            message.range / max(bins, 1),
            speed_of_sound=_speed_of_sound(message.speed_of_sound),
        )
    ]


def sonar_ping_360(message: Any) -> List[BeamFields]:
    """Read a SonarPing360 of bluerobotics_sonar: `range` metres in the bins of `profile_data`."""
    strengths = _strengths(message.profile_data)
    resolution = message.range / max(strengths.size, 1)
    return [BeamFields(stamp_ns(message.header), message.header.frame_id, message.angle, strengths, resolution)]


def scan_line(message: Any) -> List[BeamFields]:
    """Read a ScanLine of micron_driver_ros; a bin ends at its `distance`."""
    strengths = _strengths([one.intensity for one in message.bins])
    step = message.bin_distance_step
    return [BeamFields(stamp_ns(message.header), message.header.frame_id, message.angle, strengths, step)]


def laser_scan(message: Any) -> List[BeamFields]:
    """Read a LaserScan: one beam with one echo for each ray; raises RefusedInput for one without range or direction.

    Rays are timed as `time_increment` says. A ray without a range becomes a beam without echoes.
    """
    if not (message.range_max > 0.0 and np.isfinite([message.range_max, message.time_increment]).all()):
        raise RefusedInput(
            "beams refused", f"range_max {message.range_max} m, time_increment {message.time_increment} s"
        )
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


def stamp_ns(header: Any) -> int:
    """Return the stamp of a header, ns; ROS 1 names its parts secs and nsecs, ROS 2 and rosbags sec and nanosec."""
    stamp = header.stamp
    if hasattr(stamp, "nanosec"):
        return int(stamp.sec) * 10**9 + int(stamp.nanosec)
    return int(stamp.secs) * 10**9 + int(stamp.nsecs)


def _speed_of_sound(value: float) -> float:
    return value if _SLOWEST <= value <= _FASTEST else USUAL_SPEED_OF_SOUND


def _strengths(values: Union[bytes, Sequence[int]]) -> np.ndarray:
    if isinstance(values, (bytes, bytearray)):
        return np.frombuffer(values, dtype=np.uint8)
    return np.asarray(values).astype(np.uint8)


def _echo_at(index: float) -> np.ndarray:
    strengths = np.zeros(_LASER_BINS, dtype=np.uint8)
    if 0.0 <= index < _LASER_BINS:
        strengths[int(index)] = _LASER_STRENGTH
    return strengths
