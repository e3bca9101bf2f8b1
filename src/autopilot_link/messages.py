"""MAVLink messages to bytes and back, by pymavlink."""

import math
from enum import IntEnum
from typing import Any, Dict, List, Optional

from autopilot_link.parameters import PoseMessage
from autopilot_link.protocol import StatedPose
from node_support.geometry import quaternion_of

try:
    from pymavlink.dialects.v20 import ardupilotmega as mavlink
except ImportError as missing:
    raise ImportError("an autopilot without MAVROS needs pymavlink: pip install pymavlink") from missing

_OUR_COMPONENT = mavlink.MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
_AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
_UNKNOWN = [math.nan] * 21
_MOST_SENDERS = 64  # addresses whose datagrams are read: a link has a few, a scanner of ports may have any


class Firmware(IntEnum):
    """What runs on an autopilot, as its HEARTBEAT says."""

    OTHER = mavlink.MAV_AUTOPILOT_GENERIC
    ARDUPILOT = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    NONE = mavlink.MAV_AUTOPILOT_INVALID
    PX4 = mavlink.MAV_AUTOPILOT_PX4


class Reader:
    """Bytes of several senders in, messages out; broken ones are left out and counted by pymavlink."""

    def __init__(self) -> None:
        self._parsers: Dict[Any, mavlink.MAVLink] = {}

    def messages(self, data: bytes, sender: Any) -> List[Any]:
        """Return the messages that these bytes of a sender complete."""
        if sender not in self._parsers:
            if len(self._parsers) >= _MOST_SENDERS:
                self._parsers.clear()
            self._parsers[sender] = mavlink.MAVLink(None)
            self._parsers[sender].robust_parsing = True
        found = self._parsers[sender].parse_buffer(data) or []
        return [message for message in found if message.get_type() != "BAD_DATA"]


def firmware_of(message: Any) -> Optional[Firmware]:
    """Return what runs on the autopilot whose HEARTBEAT this is; None for other messages and senders."""
    if message.get_type() != "HEARTBEAT" or message.get_srcComponent() != _AUTOPILOT:
        return None
    known = [one for one in Firmware if one == message.autopilot]
    found = known[0] if known else Firmware.OTHER
    return None if found is Firmware.NONE else found


def is_of_autopilot(message: Any, system: int) -> bool:
    return message.get_srcSystem() == system and message.get_srcComponent() == _AUTOPILOT


class Writer:
    """Makes the bytes of all that is ever sent: the position, and questions and answers of TIMESYNC."""

    def __init__(self) -> None:
        self._header = mavlink.MAVLink(None, srcComponent=_OUR_COMPONENT)

    def time_sync(self, system: int, autopilot_ns: int, sent_ns: int) -> bytes:
        """Return a question (autopilot_ns is 0) or an answer of TIMESYNC."""
        return self._packed(system, mavlink.MAVLink_timesync_message(autopilot_ns, sent_ns))

    def pose(self, system: int, firmware: Firmware, kind: PoseMessage, pose: StatedPose) -> bytes:
        """Return a position with the stamp that it has."""
        is_odometry = kind is PoseMessage.ODOMETRY
        return self._packed(system, _odometry(pose, firmware) if is_odometry else _vision_position(pose))

    def _packed(self, system: int, message: Any) -> bytes:
        self._header.srcSystem = system
        data = message.pack(self._header)
        self._header.seq = (self._header.seq + 1) % 256
        return bytes(data)


def _odometry(pose: StatedPose, firmware: Firmware) -> Any:
    # ArduPilot takes its north, east, down by this name only; PX4 takes the name for axes of unknown heading.
    frame = mavlink.MAV_FRAME_LOCAL_NED if firmware is Firmware.PX4 else mavlink.MAV_FRAME_LOCAL_FRD
    x, y, z, w = quaternion_of(pose.in_ned).tolist()
    return mavlink.MAVLink_odometry_message(
        pose.stamp_ns // 1000, frame, mavlink.MAV_FRAME_BODY_FRD, *pose.in_ned[:3, 3], [w, x, y, z],
        *pose.velocity_frd, math.nan, math.nan, math.nan, pose.covariance_ned.tolist(), _UNKNOWN, pose.reset_counter,
    )  # fmt: skip


def _vision_position(pose: StatedPose) -> Any:
    position, angles = pose.in_ned[:3, 3], pose.roll_pitch_yaw
    return mavlink.MAVLink_vision_position_estimate_message(
        pose.stamp_ns // 1000, *position, *angles, pose.covariance_ned.tolist(), pose.reset_counter
    )
