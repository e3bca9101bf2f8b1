"""Messages of the ping protocol to bytes and back, by the manufacturer's own library `bluerobotics-ping`."""

import math
import struct
from enum import IntEnum
from typing import List, NamedTuple

try:
    from brping.definitions import payload_dict_common, payload_dict_ping1d, payload_dict_ping360
    from brping.pingmessage import PingMessage, variable_msgs
except ImportError as missing:
    raise ImportError("a Ping360 needs the library bluerobotics-ping: pip install bluerobotics-ping") from missing

HEADER_LENGTH = PingMessage.headerLength
CHECKSUM_LENGTH = PingMessage.checksumLength
START = bytes([PingMessage.start_1, PingMessage.start_2])

# Bytes of payload: a beam of 1,200 samples takes 1,220. A longer message is none.
_LONGEST_PAYLOAD = 2048
# An echo sounder of the same maker may share the line, and the log.
_KNOWN = {**payload_dict_common, **payload_dict_ping1d, **payload_dict_ping360}
_UNKNOWN = float("inf")


class MessageId(IntEnum):
    """The messages that driver and emulated head use, by their numbers in the ping protocol."""

    ACK = 1
    NACK = 2
    DEVICE_INFORMATION = 4
    GENERAL_REQUEST = 6
    SOUNDING = 1212
    SOUNDING_PROFILE = 1300
    DEVICE_DATA = 2300
    AUTO_DEVICE_DATA = 2301
    TRANSDUCER = 2601
    AUTO_TRANSMIT = 2602
    MOTOR_OFF = 2903


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


_BEAMS = (MessageId.DEVICE_DATA, MessageId.AUTO_DEVICE_DATA)


class ParsedMessage(NamedTuple):
    """A message, its bytes, and the position of the first of them in the stream, counted from the start."""

    offset: int
    frame: bytes
    message: PingMessage


class MessageStream:
    """Incremental parser. No whole message is lost because of what is around it; never raises.

    `broken` counts messages that are not whole, until its reader sets it back to 0. It goes by the headers that began
    them, and by the length of what lies between whole messages, of which each beam explains as much as the last whole
    beam was long.
    """

    def __init__(self) -> None:
        self.broken = 0
        self._buffer = bytearray()
        self._offset = 0
        self._beam_length = _UNKNOWN
        self._begin_stretch()

    @property
    def pending(self) -> bool:
        return bool(self._buffer)

    @property
    def missing(self) -> int:
        """Number of bytes that complete the message that has begun; 1 when none has."""
        if len(self._buffer) < HEADER_LENGTH:
            return 1
        return max(1, frame_length(self._buffer) - len(self._buffer))

    def feed(self, data: bytes) -> List[ParsedMessage]:
        """Take the next bytes of the stream and return the messages that they complete."""
        self._buffer += data
        found = []
        while self._skip_to_header():
            length = frame_length(self._buffer)
            if len(self._buffer) >= length and is_whole(self._buffer[:length]):
                found.append(self._take(length))
            else:
                if len(self._buffer) < length and not self._holds_another():
                    break
                # The next one may lie inside it, where its own end is lost.
                self._stretch_headers += 1
                self._skip_rubbish(len(START))
        return found

    def reset(self) -> None:
        if self._buffer:
            self._skip_rubbish(len(self._buffer))
        self._begin_stretch()

    def _skip_to_header(self) -> bool:
        """Drop what comes before a plausible header; return whether there is one."""
        while True:
            start = self._buffer.find(START)
            if start < 0:
                start = len(self._buffer) - int(self._buffer.endswith(START[:1]))
            if start > 0:
                self._skip_rubbish(start)
            if len(self._buffer) < HEADER_LENGTH:
                return False
            if _is_header(self._buffer):
                return True
            self._skip_rubbish(len(START))

    def _take(self, length: int) -> ParsedMessage:
        frame = bytes(self._buffer[:length])
        parsed = ParsedMessage(self._offset, frame, PingMessage(msg_data=frame))
        self._skip(length)
        if parsed.message.message_id in _BEAMS:
            self._beam_length = length
        self._begin_stretch()
        return parsed

    def _holds_another(self) -> bool:
        """Return whether a whole message lies inside an unfinished one, whose own end was then lost."""
        start = self._buffer.find(START, 1)
        while 0 <= start <= len(self._buffer) - HEADER_LENGTH:
            inner = self._buffer[start:]
            if _is_header(inner) and len(inner) >= frame_length(inner) and is_whole(inner[: frame_length(inner)]):
                return True
            start = self._buffer.find(START, start + 1)
        return False

    def _skip_rubbish(self, count: int) -> None:
        """Drop bytes of a stretch between whole messages, and count the messages that it was."""
        self._stretch_bytes += count
        number = max(1, self._stretch_headers, math.ceil(self._stretch_bytes / self._beam_length))
        self.broken += number - self._stretch_messages
        self._stretch_messages = number
        self._skip(count)

    def _begin_stretch(self) -> None:
        self._stretch_bytes = self._stretch_headers = self._stretch_messages = 0

    def _skip(self, count: int) -> None:
        del self._buffer[:count]
        self._offset += count


def _is_header(data: bytes) -> bool:
    try:
        frame_length(data)
    except MessageError:
        return False
    return True
