"""Converts beams of the head to sonar messages."""

import rospy

from ping360_driver.protocol.angles import head_angle
from ping360_driver.protocol.replies import Beam
from ping360_driver.protocol.sampling import bin_length
from underwater_map_construction.msg import SonarScanLine


def scan_line(
    stamp: float, beam: Beam, speed_of_sound: float, frame_id: str, inverted: bool = False, sensor_angle: float = 0.0
) -> SonarScanLine:
    """Return the message of the ping at `stamp` (s); its range is what the head's own sample period makes of it."""
    message = SonarScanLine()
    message.header.stamp = rospy.Time.from_sec(stamp)
    message.header.frame_id = frame_id
    message.angle = head_angle(beam.angle, inverted)
    message.intensities = beam.echoes
    message.range_resolution = bin_length(beam.pulse.sample_period, speed_of_sound)
    message.maxrange_meters = len(beam.echoes) * message.range_resolution
    message.gain = beam.pulse.gain_setting
    message.sensorAngle = sensor_angle
    return message
