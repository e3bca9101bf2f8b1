"""Messages of the ping protocol to bytes and back, by the manufacturer's own library `bluerobotics-ping`."""

import struct
from enum import IntEnum

try:
    from brping.definitions import payload_dict_common, payload_dict_ping360
    from brping.pingmessage import PingMessage, variable_msgs
except ImportError as missing:
    raise ImportError("a Ping360 needs the library bluerobotics-ping: pip install bluerobotics-ping") from missing

HEADER_LENGTH = PingMessage.headerLength
CHECKSUM_LENGTH = PingMessage.checksumLength
START = bytes([PingMessage.start_1, PingMessage.start_2])

# Bytes of payload: a beam of 1,200 samples takes 1,220. A longer message is none.
_LONGEST_PAYLOAD = 2048


class MessageId(IntEnum):
    """The messages that driver and emulated head use, by their numbers in the ping protocol."""

    ACK = 1
    NACK = 2
    DEVICE_INFORMATION = 4
    GENERAL_REQUEST = 6
    DEVICE_DATA = 2300
    AUTO_DEVICE_DATA = 2301
    TRANSDUCER = 2601
    AUTO_TRANSMIT = 2602
    MOTOR_OFF = 2903


_KNOWN = {**payload_dict_common, **payload_dict_ping360}
_OF_ANY_LENGTH = {*variable_msgs, MessageId.NACK}


class MessageError(ValueError):
    """Bytes that are no message, or a message that no Ping360 sends; the text names field and value."""


def packed(message_id: MessageId, **fields: object) -> bytes:
    """Return the bytes of a message with these fields; the others are 0."""
    message = PingMessage(message_id)
    for name, value in fields.items():
        setattr(message, name, value)
    return bytes(message.pack_msg_data())


def packed_nack(nacked_id: MessageId, reason: str) -> bytes:
    """Return the bytes of a refusal, which the library can read but not make (0.2.5)."""
    payload = struct.pack("<H", nacked_id) + reason.encode("ascii")
    frame = START + struct.pack("<HHBB", len(payload), MessageId.NACK, 0, 0) + payload
    return frame + struct.pack("<H", sum(frame) & 0xFFFF)


def unpacked(frame: bytes) -> PingMessage:
    """Return the message of a whole frame, whose length and checksum are right (`is_whole`)."""
    return PingMessage(msg_data=bytes(frame))


def frame_length(header: bytes) -> int:
    """Return the length of the frame that these 8 bytes begin; raises MessageError if they begin none.

    The library would wait for up to 65,535 bytes when a length is garbled, and lose every message among them.
    """
    payload_length, message_id = struct.unpack_from("<HH", header, len(START))
    if header[: len(START)] != START:
        raise MessageError(f"a message begins with {bytes(header[:2])!r}: must be {START!r}")
    if message_id not in _KNOWN:
        raise MessageError(f"message_id = {message_id}: no such message")
    least = _KNOWN[message_id]["payload_length"]
    most = _LONGEST_PAYLOAD if message_id in _OF_ANY_LENGTH else least
    if not least <= payload_length <= most:
        raise MessageError(f"payload_length = {payload_length} of message {message_id}: must be {least} to {most}")
    return HEADER_LENGTH + payload_length + CHECKSUM_LENGTH


def is_whole(frame: bytes) -> bool:
    """Return whether the checksum of a frame of the right length is right."""
    return sum(frame[:-CHECKSUM_LENGTH]) & 0xFFFF == struct.unpack("<H", frame[-CHECKSUM_LENGTH:])[0]
