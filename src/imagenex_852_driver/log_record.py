"""One ping of the manufacturer's `.852` log, bytes to dataclass and back (Data storage file format, 16SEP15)."""

import calendar
import re
import time
from dataclasses import dataclass
from typing import Optional

from imagenex_852_driver.protocol.command import SwitchCommand
from imagenex_852_driver.protocol.reply import FrameError, Reply, ReplyKind, require

MAGIC = b"852"
HEADER_LENGTH = 100  # Bytes before the reply in each record (manufacturer's log format)

_INDICES = {ReplyKind.IPX: 0, ReplyKind.IMX: 2, ReplyKind.IGX: 3}
_RECORD_LENGTHS = {ReplyKind.IPX: 128, ReplyKind.IMX: 384, ReplyKind.IGX: 640}
_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
_STAMP = re.compile(rb"(\d\d)-([A-Za-z]{3})-(\d{4})\0(\d\d):(\d\d):(\d\d)\0\.(\d\d)\0")
_ZERO_TRAIN = 70  # Code of train angle 0 (manufacturer's log format)
# Bytes that the manufacturer calls reserved but always writes, and 1500 m/s, which the head makes ranges with: flagged
# as known, in tenths.
_CONSTANT = {42: 20, 43: 9, 46: 0x80 | 15000 >> 8, 47: 15000 & 0xFF}


@dataclass(frozen=True)
class LoggedPing:
    """One ping of a log.

    `stamp` is seconds since 1970 (the log's date and time taken as UTC, hundredths), None if they cannot be read;
    degrees are clockwise, as the head counts them. Sector, train angle, step and direction of an echo sounder mean
    nothing. The user's text and what the logger's own sensors measured are left out.
    """

    reply: Reply
    stamp: Optional[float] = None
    clockwise: bool = True
    transducer_up: bool = False
    step_code: int = 0
    start_gain_db: int = 0
    sector_width_deg: int = 0
    train_angle_deg: int = 0
    pulse_length_us: int = 0
    profile: int = 0
    frequency_khz: int = 675

    @classmethod
    def of(cls, stamp: float, command: SwitchCommand, reply: Reply) -> "LoggedPing":
        """Return the log's form of a ping of the driver."""
        return cls(
            reply=reply,
            stamp=stamp,
            clockwise=reply.clockwise,
            step_code=command.step_size_deg // 3,
            start_gain_db=command.start_gain_db,
            sector_width_deg=command.sector_width_deg,
            train_angle_deg=command.train_angle_deg,
            pulse_length_us=command.pulse_length_us,
            profile=int(command.profile),
            frequency_khz=command.frequency_khz,
        )

    def encode(self) -> bytes:
        """Return the bytes of the record; raise FrameError for a value that a record cannot hold."""
        kind = self.reply.kind
        record = bytearray(_RECORD_LENGTHS[kind])
        record[0:3] = MAGIC
        record[3] = _INDICES[kind]
        record[4:6] = len(record).to_bytes(2, "big")
        record[6:8] = kind.length.to_bytes(2, "big")
        record[8:33] = _encoded_stamp(self.stamp)
        for index, value in {**_CONSTANT, **self._header_bytes()}.items():
            require(f"byte {index} of the log record", value, range(256))
            record[index] = value
        record[HEADER_LENGTH : HEADER_LENGTH + kind.length] = self.reply.encode()
        return bytes(record)

    def _header_bytes(self) -> dict:
        polar = self.reply.kind is ReplyKind.IMX
        require("step_code", self.step_code, range(8))
        return {
            37: self.clockwise << 7 | self.transducer_up << 6 | polar << 3 | self.step_code,
            38: self.start_gain_db,
            39: self.sector_width_deg // 3,
            40: self.train_angle_deg // 3 + _ZERO_TRAIN,
            44: self.pulse_length_us,
            45: self.profile,
            87: int(self.frequency_khz == 850),
            88: self.reply.head_id,
        }


def decode_record(record: bytes) -> LoggedPing:
    """Read one record, with or without zero fill; raise FrameError if its header or reply is inconsistent."""
    kind = check_record_header(record)
    return LoggedPing(
        reply=Reply.decode(record[HEADER_LENGTH : HEADER_LENGTH + kind.length]),
        stamp=_decoded_stamp(record[8:33]),
        clockwise=bool(record[37] & 0x80),
        transducer_up=bool(record[37] & 0x40),
        step_code=record[37] & 0x07,
        start_gain_db=record[38],
        sector_width_deg=record[39] * 3,
        train_angle_deg=(record[40] - _ZERO_TRAIN) * 3,
        pulse_length_us=record[44],
        profile=record[45],
        frequency_khz=850 if record[87] == 1 else 675,
    )


def check_record_header(data: bytes) -> ReplyKind:
    """Return the kind of reply in the record that `data` begins with; raise FrameError without a record."""
    require("first letters of the log record", bytes(data[:3]), (MAGIC,))
    require("length of the log header", len(data) >= 8, (True,))
    for kind, index in _INDICES.items():
        if data[3] == index:
            require("record length", int.from_bytes(data[4:6], "big"), (_RECORD_LENGTHS[kind],))
            require("reply length", int.from_bytes(data[6:8], "big"), (kind.length,))
            return kind
    raise FrameError(f"echo index of the log record = {data[3]}: must be one of 0, 2, 3")


def record_length(kind: ReplyKind) -> int:
    """Return the number of bytes a ping takes in the file."""
    return _RECORD_LENGTHS[kind]


def _encoded_stamp(stamp: Optional[float]) -> bytes:
    if stamp is None:
        return bytes(25)
    seconds, hundredths = divmod(round(stamp * 100), 100)
    t = time.gmtime(seconds)
    date = f"{t.tm_mday:02d}-{_MONTHS[t.tm_mon - 1]}-{t.tm_year:04d}\0"
    return f"{date}{t.tm_hour:02d}:{t.tm_min:02d}:{t.tm_sec:02d}\0.{hundredths:02d}\0".encode("ascii")


def _decoded_stamp(data: bytes) -> Optional[float]:
    match = _STAMP.fullmatch(data)
    month = match.group(2).decode("ascii").capitalize() if match else ""
    if month not in _MONTHS:
        return None
    day, year, hour, minute, second, hundredths = (int(match.group(i)) for i in (1, 3, 4, 5, 6, 7))
    fields = (year, _MONTHS.index(month) + 1, day, hour, minute, second)
    seconds = calendar.timegm(fields) if year >= 1970 and 1 <= day <= 31 else None
    # timegm carries 31 February over into March instead of refusing it.
    if seconds is None or tuple(time.gmtime(seconds)[:6]) != fields:
        return None
    return seconds + hundredths / 100
