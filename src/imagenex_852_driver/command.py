"""The switch command, 27 bytes to the head (thesis 4.1.4, manufacturer's serial interface specification)."""

from dataclasses import dataclass
from typing import Container, List, NamedTuple

from imagenex_852_driver.reply import HEAD_IDS, RANGES, SONAR_HEAD_ID, FrameError, ReplyKind, require

HEADER = b"\xfe\x44"
TERMINATOR = 0xFD  # Bytes and codes of the manufacturer's serial interface specification
LENGTH = 27

_REVERSE_BYTE, _REVERSE_BIT = 5, 0x40


class _Switch(NamedTuple):
    """Where a setting stands in the command, and its values: `step` for each count of the byte, from `zero` on."""

    byte: int
    allowed: Container[int]
    step: int = 1
    zero: int = 0


_SWITCHES = {
    "head_id": _Switch(2, HEAD_IDS),
    "max_range": _Switch(3, RANGES),
    "start_gain_db": _Switch(8, range(41)),
    "absorption_centi_db_per_m": _Switch(10, range(256)),
    "train_angle_deg": _Switch(11, range(-210, 211, 3), 3, -210),
    "sector_width_deg": _Switch(12, range(0, 361, 3), 3),
    "step_size_deg": _Switch(13, range(0, 7, 3), 3),
    "pulse_length_us": _Switch(14, range(1, 256)),
    "data_points": _Switch(19, (250, 500), 10),
    "profile": _Switch(22, (False, True)),
    "switch_delay_ms": _Switch(24, range(0, 511, 2), 2),
    "frequency_khz": _Switch(25, (675, 850), 175, 675),
}


@dataclass(frozen=True)
class SwitchCommand:
    """One command to ping, in the head's own units; angles are degrees, clockwise as the head counts them.

    `data_points` is nominal: 250 is answered with 252 echoes. `profile` asks an echo sounder for its depth
    only.
    Raises FrameError for a value the wire cannot carry.
    """

    max_range: int
    head_id: int = SONAR_HEAD_ID
    reverse: bool = False
    start_gain_db: int = 20
    absorption_centi_db_per_m: int = 20
    train_angle_deg: int = 0
    sector_width_deg: int = 360
    step_size_deg: int = 3
    pulse_length_us: int = 100
    data_points: int = 500
    switch_delay_ms: int = 0
    frequency_khz: int = 675
    profile: bool = False

    def __post_init__(self) -> None:
        for name, switch in _SWITCHES.items():
            require(name, getattr(self, name), switch.allowed)
        self.encode()

    @property
    def reply_kind(self) -> ReplyKind:
        if self.profile:
            return ReplyKind.IPX
        return ReplyKind.IGX if self.data_points == 500 else ReplyKind.IMX

    def encode(self) -> bytes:
        """Return the 27 bytes of the command; raise FrameError if one of them would end it early."""
        frame = bytearray(LENGTH)
        frame[0:2] = HEADER
        frame[_REVERSE_BYTE] = _REVERSE_BIT if self.reverse else 0
        for name, switch in _SWITCHES.items():
            frame[switch.byte] = (getattr(self, name) - switch.zero) // switch.step
            if frame[switch.byte] == TERMINATOR:
                raise FrameError(f"byte {switch.byte} of the switch command would be 253, which ends a command")
        frame[-1] = TERMINATOR
        return bytes(frame)

    @classmethod
    def decode(cls, frame: bytes) -> "SwitchCommand":
        """Read the 27 bytes of a command; raise FrameError for a command that a head would not accept."""
        require("length of the switch command", len(frame), (LENGTH,))
        require("header of the switch command", bytes(frame[:2]), (HEADER,))
        require("position of the terminator", bytes(frame).find(TERMINATOR), (LENGTH - 1,))
        values = {name: frame[switch.byte] * switch.step + switch.zero for name, switch in _SWITCHES.items()}
        return cls(reverse=bool(frame[_REVERSE_BYTE] & _REVERSE_BIT), **values)


class CommandReader:
    """Incremental reader of switch commands; drops what is none."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> List[SwitchCommand]:
        """Take the next bytes of the stream, return the commands they complete; never raises."""
        self._buffer += data
        commands = []
        while len(self._buffer) >= LENGTH:
            try:
                commands.append(SwitchCommand.decode(bytes(self._buffer[:LENGTH])))
                del self._buffer[:LENGTH]
            except FrameError:
                del self._buffer[:1]
        return commands
