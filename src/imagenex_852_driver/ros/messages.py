"""Converts replies of the head to sonar messages and back."""

from dataclasses import replace
from typing import Optional

import rospy

from imagenex_852_driver.logs.log_record import LoggedPing
from imagenex_852_driver.protocol import Reply, ReplyKind
from imagenex_852_driver.protocol.angles import head_angle, head_position
from imagenex_852_driver.protocol.settings import HeadSettings
from node_support.errors import RefusedInput
from underwater_map_construction.msg import SonarScanLine

_KINDS = {kind.echo_count: kind for kind in ReplyKind if kind.echo_count}


def scan_line(
    stamp: float, reply: Reply, gain_db: int, frame_id: str, inverted: bool = False, sensor_angle: float = 0.0
) -> Optional[SonarScanLine]:
    """Return the message of the reply to the ping at `stamp` (s); None if it holds no echoes."""
    if not reply.echoes:
        return None
    message = SonarScanLine()
    message.header.stamp = rospy.Time.from_sec(stamp)
    message.header.frame_id = frame_id
    message.angle = head_angle(reply.head_position, inverted)
    message.intensities = reply.echoes
    message.maxrange_meters = reply.max_range
    message.range_resolution = reply.range_resolution
    message.gain = gain_db
    message.sensorAngle = sensor_angle
    return message


def logged_ping(
    message: SonarScanLine, settings: HeadSettings, inverted: bool = False, clockwise: bool = True
) -> LoggedPing:
    """Return the log's form of a message, with the settings that the message does not contain.

    Raises RefusedInput for a message that a head of this kind cannot have sent.
    """
    kind = _KINDS.get(len(message.intensities))
    if kind is None:
        counts = " or ".join(str(count) for count in _KINDS)
        raise RefusedInput("beams refused", f"{len(message.intensities)} intensities, a log takes {counts}")
    try:
        reply = Reply(
            kind,
            max_range=round(message.maxrange_meters),
            echoes=bytes(message.intensities),
            head_id=settings.head_id,
            head_position=head_position(message.angle, inverted),
            clockwise=clockwise,
        )
    except ValueError as error:
        raise RefusedInput("beams refused", str(error)) from error
    return replace(LoggedPing.of(message.header.stamp.to_sec(), settings.command(), reply), start_gain_db=message.gain)
