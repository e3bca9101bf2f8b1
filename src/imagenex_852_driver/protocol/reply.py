"""The head's reply: 12 bytes of header, 0, 252 or 500 echo strengths, one terminator (thesis 4.1.4); and its angles."""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any, Container

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
        """Number of echo strengths in a reply of this kind."""
        return _ECHO_COUNTS[self]

    @property
    def length(self) -> int:
        """Number of bytes of the whole reply."""
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
        """Return the bytes of the reply as the head sends them."""
        position_high = (self.head_position >> 8) << 1 | (self.head_position >> 7) & 1
        direction = _CLOCKWISE_BIT if self.clockwise else 0
        header = bytes(
            [
                *self.kind.value,
                self.head_id,
                self.status,
                self.head_position & 0x7F,
                direction | position_high,
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
        low, high = frame[5], frame[6]
        return cls(
            kind=kind,
            head_id=frame[3],
            status=frame[4],
            head_position=(high & 0x3E) >> 1 << 8 | (high & 1) << 7 | low & 0x7F,
            clockwise=bool(high & _CLOCKWISE_BIT),
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
    return bytes([value & 0x7F, (value >> 8) << 1 | (value >> 7) & 1])


def _unpacked(low: int, high: int) -> int:
    return (high & 0x7E) >> 1 << 8 | (high & 1) << 7 | low & 0x7F
