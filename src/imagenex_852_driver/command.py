"""The switch command, 27 bytes to the head (thesis 4.1.4, manufacturer's serial interface specification)."""

from dataclasses import dataclass, fields
from typing import List

from imagenex_852_driver.reply import HEAD_IDS, RANGES, SONAR_HEAD_ID, FrameError, ReplyKind, require

HEADER = b"\xfe\x44"
TERMINATOR = 0xFD  # Bytes and codes of the manufacturer's serial interface specification
LENGTH = 27

_REVERSE_BIT = 0x40
_TRAIN_ANGLE_OFFSET_DEG = 210
_FREQUENCIES_KHZ = (675, 850)
_POINTS_PER_CODE = 10

_ALLOWED = {
    "head_id": HEAD_IDS,
    "max_range": RANGES,
    "reverse": (False, True),
    "start_gain_db": range(41),
    "absorption_centi_db_per_m": range(256),
    "train_angle_deg": range(-210, 211, 3),
    "sector_width_deg": range(0, 361, 3),
    "step_size_deg": range(0, 7, 3),
    "pulse_length_us": range(1, 256),
    "profile": (False, True),
    "data_points": (250, 500),
    "switch_delay_ms": range(0, 511, 2),
    "frequency_khz": _FREQUENCIES_KHZ,
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
        for field in fields(self):
            require(field.name, getattr(self, field.name), _ALLOWED[field.name])
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
        for index, value in self._switches().items():
            if value == TERMINATOR:
                raise FrameError(f"byte {index} of the switch command would be 253, which ends a command")
            frame[index] = value
        frame[-1] = TERMINATOR
        return bytes(frame)

    def _switches(self) -> dict:
        return {
            2: self.head_id,
            3: self.max_range,
            5: _REVERSE_BIT if self.reverse else 0,
            8: self.start_gain_db,
            10: self.absorption_centi_db_per_m,
            11: (self.train_angle_deg + _TRAIN_ANGLE_OFFSET_DEG) // 3,
            12: self.sector_width_deg // 3,
            13: self.step_size_deg // 3,
            14: self.pulse_length_us,
            19: self.data_points // _POINTS_PER_CODE,
            22: int(self.profile),
            24: self.switch_delay_ms // 2,
            25: _FREQUENCIES_KHZ.index(self.frequency_khz),
        }

    @classmethod
    def decode(cls, frame: bytes) -> "SwitchCommand":
        """Read the 27 bytes of a command; raise FrameError for a command that a head would not accept."""
        require("length of the switch command", len(frame), (LENGTH,))
        require("header of the switch command", bytes(frame[:2]), (HEADER,))
        require("position of the terminator", bytes(frame).find(TERMINATOR), (LENGTH - 1,))
        require("frequency code", frame[25], range(len(_FREQUENCIES_KHZ)))
        return cls(
            head_id=frame[2],
            max_range=frame[3],
            reverse=bool(frame[5] & _REVERSE_BIT),
            start_gain_db=frame[8],
            absorption_centi_db_per_m=frame[10],
            train_angle_deg=frame[11] * 3 - _TRAIN_ANGLE_OFFSET_DEG,
            sector_width_deg=frame[12] * 3,
            step_size_deg=frame[13] * 3,
            pulse_length_us=frame[14],
            data_points=frame[19] * _POINTS_PER_CODE,
            profile=bool(frame[22]),
            switch_delay_ms=frame[24] * 2,
            frequency_khz=_FREQUENCIES_KHZ[frame[25]],
        )


class CommandReader:
    """Incremental reader of switch commands; `rejected` counts commands that began but turned out to be invalid."""

    def __init__(self) -> None:
        self.rejected = 0
        self._buffer = bytearray()

    def feed(self, data: bytes) -> List[SwitchCommand]:
        """Take the next bytes of the stream, return the commands they complete; never raises."""
        self._buffer += data
        commands = []
        while self._find_header() and len(self._buffer) >= LENGTH:
            try:
                commands.append(SwitchCommand.decode(bytes(self._buffer[:LENGTH])))
                del self._buffer[:LENGTH]
            except FrameError:
                self.rejected += 1
                del self._buffer[:1]
        return commands

    def _find_header(self) -> bool:
        start = self._buffer.find(HEADER)
        if start < 0:
            del self._buffer[: -1 if self._buffer.endswith(HEADER[:1]) else None]
            return False
        del self._buffer[:start]
        return True
