"""What the head sends, as far as the driver uses it."""

from dataclasses import dataclass
from typing import Optional, Tuple

from ping360_driver.protocol.messages import MessageError, MessageId, PingMessage
from ping360_driver.protocol.scan_command import TURN, PulseSettings

_PING360 = 2  # Device type (ping protocol)
# Ping Viewer lets the head scan by itself from the first firmware after this one.
_LAST_WITHOUT_AUTO_TRANSMIT = (3, 3, 0)


@dataclass(frozen=True)
class Beam:
    """One beam, in the head's own units.

    `angle` in gradians from 0 to 399; `echoes` holds one strength (0 to 255) per sample, nearest first; `sector` is
    (start, stop, step) in gradians when the head scans by itself.
    """

    angle: int
    pulse: PulseSettings
    echoes: bytes
    sector: Optional[Tuple[int, int, int]] = None


@dataclass(frozen=True)
class DeviceInformation:
    """Who is at the other end of the line."""

    device_type: int
    firmware: Tuple[int, int, int]

    @property
    def is_ping360(self) -> bool:
        """Whether it is a Ping360."""
        return self.device_type == _PING360

    @property
    def can_auto_transmit(self) -> bool:
        """Whether its firmware can scan a sector by itself."""
        return self.firmware > _LAST_WITHOUT_AUTO_TRANSMIT


def beam(message: PingMessage) -> Beam:
    """Return the beam of a DEVICE_DATA or AUTO_DEVICE_DATA message; raises MessageError if it is inconsistent."""
    echoes = bytes(message.data)
    if message.angle >= TURN:
        raise MessageError(f"angle = {message.angle}: must be 0 to {TURN - 1}")
    if message.data_length != len(echoes):
        raise MessageError(f"data_length = {message.data_length}: the message holds {len(echoes)} samples")
    if not message.sample_period:
        raise MessageError("sample_period = 0: must be positive")
    automatic = message.message_id == MessageId.AUTO_DEVICE_DATA
    sector = (message.start_angle, message.stop_angle, message.num_steps) if automatic else None
    pulse = PulseSettings(**{name: getattr(message, name) for name in PulseSettings.__dataclass_fields__})
    return Beam(message.angle, pulse, echoes, sector)


def device_information(message: PingMessage) -> DeviceInformation:
    """Return what a DEVICE_INFORMATION message says."""
    return DeviceInformation(
        message.device_type,
        (message.firmware_version_major, message.firmware_version_minor, message.firmware_version_patch),
    )


def refusal(message: PingMessage) -> str:
    """Return in words what a NACK message says."""
    reason = bytes(getattr(message, "nack_message", b"")).decode("ascii", "replace").strip("\0")
    return f"the head refused message {message.nacked_id}: {reason or 'no reason given'}"
