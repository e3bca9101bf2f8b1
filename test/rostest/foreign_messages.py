"""Messages of other packages' sonars, made from their definitions, as a driver would send them."""

import time
from functools import lru_cache
from io import BytesIO
from typing import Any, Callable, Dict

import genpy
import genpy.dynamic

_HEADER = """
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
"""
DEFINITIONS: Dict[str, str] = {
    "ping360_sonar/SonarEcho": f"""Header header
float32 angle
uint8 gain
uint16 number_of_samples
uint16 transmit_frequency
uint16 speed_of_sound
uint8 range
uint8[] intensities
{_HEADER}""",
    "bluerobotics_sonar_msgs/SonarPing360": f"""std_msgs/Header header
float32 distance
uint8 mode
uint8 gain_setting
uint16 angle
uint16 transmit_duration
uint16 sample_period
uint16 transmit_frequency
float32 range
uint8[] profile_data
{_HEADER}""",
    "micron_driver_ros/ScanLine": f"""Header header
float32 angle
float32 bin_distance_step
micron_driver_ros/IntensityBin[] bins
{_HEADER}
================================================================================
MSG: micron_driver_ros/IntensityBin
float32 distance
uint8 intensity
""",
}
"""Type in ROS 1 to its definition with all that it is made of."""

_BINS, _RANGE, _STRONG_BIN = 50, 20.0, 30
_DEGREES_PER_STEP = 1.8


@lru_cache(maxsize=None)
def message_classes(kind: str) -> Dict[str, type]:
    """Return the classes of a type of `DEFINITIONS` and of what it is made of, by their names."""
    return genpy.dynamic.generate_dynamic(kind, DEFINITIONS[kind])


def sane_message(kind: str, step: int) -> genpy.Message:
    """Return what a head says that looks at step number `step` of 200 and hears a wall at 12 m."""
    message = message_classes(kind)[kind]()
    message.header.stamp = genpy.Time.from_sec(time.time())
    message.header.frame_id = "sonar"
    strengths = bytes(120 if abs(number - _STRONG_BIN) < 2 else 3 for number in range(_BINS))
    _FILLED[kind](message, step % 200, strengths)
    return message


def serialised(message: genpy.Message) -> bytes:
    """Return the bytes of a message on the wire."""
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def _fill_echo(message: Any, step: int, strengths: bytes) -> None:
    message.angle = float(2 * step)
    message.number_of_samples, message.speed_of_sound, message.range = len(strengths), 1500, int(_RANGE)
    message.intensities = strengths


def _fill_ping_360(message: Any, step: int, strengths: bytes) -> None:
    message.angle, message.range, message.profile_data = 2 * step, _RANGE, strengths


def _fill_scan_line(message: Any, step: int, strengths: bytes) -> None:
    message.angle, message.bin_distance_step = _DEGREES_PER_STEP * step - 180.0, _RANGE / len(strengths)
    one = message_classes("micron_driver_ros/ScanLine")["micron_driver_ros/IntensityBin"]
    message.bins = [one(number * message.bin_distance_step, strength) for number, strength in enumerate(strengths, 1)]


_FILLED: Dict[str, Callable[[Any, int, bytes], None]] = {
    "ping360_sonar/SonarEcho": _fill_echo,
    "bluerobotics_sonar_msgs/SonarPing360": _fill_ping_360,
    "micron_driver_ros/ScanLine": _fill_scan_line,
}
