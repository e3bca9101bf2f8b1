"""The head's reply: 12 bytes of header, 0, 252 or 500 echo strengths, one terminator (thesis 4.1.4); its angles."""

import math
import re
from dataclasses import dataclass
from enum import Enum
from typing import Any, Container, List, NamedTuple, Optional

RANGES = (5, 10, 20, 30, 40, 50)  # m: the only ranges that the head takes (manufacturer's specification)
SONAR_HEAD_ID = 0x10  # As delivered (manufacturer's specification)
HEAD_IDS = range(0x10, 0x16)
AHEAD = 1400  # Head position straight ahead; positions are 0.15 deg, clockwise (manufacturer's specification)
_RADIANS_PER_POSITION = math.radians(0.15)
HEADER_LENGTH = 12  # Lengths, bytes and bits of the manufacturer's serial interface specification
TERMINATOR = 0xFC
SWITCHES_ACCEPTED = 0x40
OVERRUN = 0x80
_CLOCKWISE_BIT = 0x40


class FrameError(ValueError):
    """A frame, or a value meant for one, that the protocol does not allow; the text names field and value."""


def require(name: str, value: Any, allowed: Container) -> None:
    """Raise FrameError unless `value` is in `allowed`."""
    if value not in allowed:
        raise FrameError(f"{name} = {value!r}: not allowed by the protocol, which takes {_in_words(allowed)}")


def _in_words(allowed: Container) -> str:
    if not isinstance(allowed, range):
        return ", ".join(str(value) for value in allowed)
    steps = f" in steps of {allowed.step}" if allowed.step != 1 else ""
    return f"{allowed[0]} to {allowed[-1]}{steps}"


class ReplyKind(Enum):
    """The three kinds of reply, by their leading letters."""

    IMX = b"IMX"
    IGX = b"IGX"
    IPX = b"IPX"

    @property
    def echo_count(self) -> int:
        return _ECHO_COUNTS[self]

    @property
    def length(self) -> int:
        return HEADER_LENGTH + self.echo_count + 1


_ECHO_COUNTS = {ReplyKind.IMX: 252, ReplyKind.IGX: 500, ReplyKind.IPX: 0}


@dataclass(frozen=True)
class Reply:
    """One reply, in the head's own units.

    `head_position` counts 0.15 deg, clockwise, 1400 is straight ahead; `clockwise` is the direction of the
    step; `echoes` holds one strength (0 to 255) per range bin, nearest first; `profile_range_cm` is an echo
    sounder's depth.
    Raises FrameError for a value the wire cannot carry.
    """

    kind: ReplyKind
    max_range: int
    echoes: bytes
    head_id: int = SONAR_HEAD_ID
    status: int = SWITCHES_ACCEPTED | 1
    head_position: int = 1400
    clockwise: bool = True
    profile_range_cm: int = 0

    def __post_init__(self) -> None:
        require("head_id", self.head_id, HEAD_IDS)
        require("max_range", self.max_range, RANGES)
        require("status", self.status, range(0x100))
        require("head_position", self.head_position, range(1 << 13))
        require("profile_range_cm", self.profile_range_cm, range(1 << 14))
        require(f"number of echoes of an {self.kind.name}", len(self.echoes), (self.kind.echo_count,))

    @property
    def switches_accepted(self) -> bool:
        """Whether the head accepted the settings of the command that it answers."""
        return bool(self.status & SWITCHES_ACCEPTED)

    @property
    def overrun(self) -> bool:
        """Whether the head lost characters of the command."""
        return bool(self.status & OVERRUN)

    @property
    def range_resolution(self) -> float:
        """Length of one range bin in metres; 0 when there are no echoes."""
        return self.max_range / len(self.echoes) if self.echoes else 0.0

    def encode(self) -> bytes:
        position_low, position_high = _packed(self.head_position)
        header = bytes(
            [
                *self.kind.value,
                self.head_id,
                self.status,
                position_low,
                position_high | (_CLOCKWISE_BIT if self.clockwise else 0),
                self.max_range,
                *_packed(self.profile_range_cm),
                *_packed(len(self.echoes)),
            ]
        )
        return header + bytes(self.echoes) + bytes([TERMINATOR])

    @classmethod
    def decode(cls, frame: bytes) -> "Reply":
        """Read exactly one complete reply; raise FrameError for anything else."""
        kind = check_header(frame)
        require("length of the reply", len(frame), (kind.length,))
        require("terminator of the reply", frame[-1], (TERMINATOR,))
        return cls(
            kind=kind,
            head_id=frame[3],
            status=frame[4],
            head_position=_unpacked(frame[5], frame[6] & ~_CLOCKWISE_BIT),
            clockwise=bool(frame[6] & _CLOCKWISE_BIT),
            max_range=frame[7],
            profile_range_cm=_unpacked(frame[8], frame[9]),
            echoes=bytes(frame[HEADER_LENGTH:-1]),
        )


def head_angle(head_position: int, inverted: bool = False) -> float:
    """Return the angle of the beam about +z from +x, counter-clockwise radians in [-pi, pi] (REP-103).

    `inverted` means a head mounted upside down: what it counts clockwise is then counter-clockwise.
    """
    clockwise = (head_position - AHEAD) * _RADIANS_PER_POSITION
    return math.remainder(clockwise if inverted else -clockwise, 2 * math.pi)


def head_position(angle: float, inverted: bool = False) -> int:
    """Return the position nearest to `angle`, among those within half a turn of straight ahead."""
    wrapped = math.remainder(angle, 2 * math.pi)
    return AHEAD + round((wrapped if inverted else -wrapped) / _RADIANS_PER_POSITION)


def check_header(data: bytes) -> ReplyKind:
    """Return the kind of reply that the first 12 bytes of `data` announce.

    Raises FrameError if they are inconsistent. Letters, head identification, range and data count must all be
    valid, so that random bytes practically never pass.
    """
    require("length of the reply header", len(data) >= HEADER_LENGTH, (True,))
    require("letters of the reply", bytes(data[:3]), tuple(kind.value for kind in ReplyKind))
    kind = ReplyKind(bytes(data[:3]))
    require("head_id", data[3], HEAD_IDS)
    require("max_range", data[7], RANGES)
    require(f"data count of an {kind.name}", _unpacked(data[10], data[11]), (kind.echo_count,))
    return kind


def _packed(value: int) -> bytes:
    """Split 14 bits into two bytes of which the low one has 7 bits, so that bit 7 is never set."""
    return bytes([value & 0x7F, value >> 7])


def _unpacked(low: int, high: int) -> int:
    return (high & 0x7F) << 7 | low & 0x7F


_LETTERS = re.compile(b"I[MGP]X")
_UNFINISHED_LETTERS = re.compile(b"I[MGP]?\\Z")
_STATUS = 4  # Index of the status byte in the header


class ParsedReply(NamedTuple):
    """A reply and the position of its first byte in the stream, counted from the last `reset`."""

    offset: int
    reply: Reply


class ReplyParser:
    """Incremental parser of replies.

    Every skipped byte is examined again, so a complete reply is never lost because of garbage before it. In return, a
    reply whose echoes form a complete reply header is taken for one that ended early.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._offset = 0

    @property
    def pending(self) -> bool:
        """Whether the buffered bytes may be the beginning of a reply."""
        return bool(self._buffer)

    def feed(self, data: bytes) -> List[ParsedReply]:
        """Take the next bytes of the stream and return the replies they complete; never raises."""
        self._buffer += data
        found = []
        while self._skip_to_letters():
            kind = ReplyKind(bytes(self._buffer[:3]))
            if len(self._buffer) >= HEADER_LENGTH and not _is_header(self._buffer):
                self._skip(1)
                continue
            inner = self._inner_header(kind.length)
            if inner is not None:
                self._skip(inner)
            elif len(self._buffer) < kind.length:
                break
            else:
                try:
                    found.append(ParsedReply(self._offset, Reply.decode(bytes(self._buffer[: kind.length]))))
                    self._skip(kind.length)
                except FrameError:
                    self._skip(1)
        return found

    def reset(self) -> None:
        """Give up waiting for the rest of a reply and count positions from zero again."""
        self._buffer.clear()
        self._offset = 0

    def _inner_header(self, length: int) -> Optional[int]:
        """Return where another reply begins inside the one at the front, whose own end was then lost."""
        is_complete = len(self._buffer) >= length
        for match in _LETTERS.finditer(self._buffer, 1, length):
            header = self._buffer[match.start() : min(match.start() + HEADER_LENGTH, length)]
            # The next reply may go on after the last byte of a complete one: its status can look like the terminator.
            is_cut = is_complete and _STATUS < len(header) < HEADER_LENGTH and header[3] in HEAD_IDS
            if is_cut or _is_header(header):
                return match.start()
        return None

    def _skip_to_letters(self) -> bool:
        match = _LETTERS.search(self._buffer)
        if match:
            self._skip(match.start())
            return True
        unfinished = _UNFINISHED_LETTERS.search(self._buffer)
        self._skip(unfinished.start() if unfinished else len(self._buffer))
        return False

    def _skip(self, count: int) -> None:
        del self._buffer[:count]
        self._offset += count


def _is_header(data: bytes) -> bool:
    try:
        check_header(data)
    except FrameError:
        return False
    return True
