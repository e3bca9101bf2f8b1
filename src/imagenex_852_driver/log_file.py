"""Reads, plays and appends to the manufacturer's `.852` logs (Data storage file format, 16SEP15)."""

import calendar
import mmap
import os
import re
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Iterable, Iterator, List, NamedTuple, Optional, Tuple, Union

from imagenex_852_driver.command import SwitchCommand
from imagenex_852_driver.reply import FrameError, Reply, ReplyKind, require

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
        require("step_code", self.step_code, range(8))
        header = {
            37: self.clockwise << 7 | self.transducer_up << 6 | (kind is ReplyKind.IMX) << 3 | self.step_code,
            38: self.start_gain_db,
            39: self.sector_width_deg // 3,
            40: self.train_angle_deg // 3 + _ZERO_TRAIN,
            44: self.pulse_length_us,
            45: self.profile,
            87: int(self.frequency_khz == 850),
            88: self.reply.head_id,
        }
        record = bytearray(_RECORD_LENGTHS[kind])
        record[0:3] = MAGIC
        record[3] = _INDICES[kind]
        record[4:6] = len(record).to_bytes(2, "big")
        record[6:8] = kind.length.to_bytes(2, "big")
        record[8:33] = _encoded_stamp(self.stamp)
        for index, value in {**_CONSTANT, **header}.items():
            require(f"byte {index} of the log record", value, range(256))
            record[index] = value
        record[HEADER_LENGTH : HEADER_LENGTH + kind.length] = self.reply.encode()
        return bytes(record)


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


USUAL_RATE = 10.0  # 1/s: pings of a head at 30 m, for logs whose stamps do not tell


def timed(pings: Iterable[LoggedPing], rate: Optional[float] = None) -> Iterator[Tuple[float, LoggedPing]]:
    """Yield every ping with its time in seconds after the first one; times never go back.

    They follow each other at `rate` (1/s). Without a rate they keep the intervals of the log's stamps, or follow
    at `USUAL_RATE` where the stamps cannot be read.
    """
    step = 1.0 / (rate or USUAL_RATE)
    time, last_stamp = 0.0, None
    for index, ping in enumerate(pings):
        if index:
            known = rate is None and ping.stamp is not None and last_stamp is not None
            time += max(0.0, ping.stamp - last_stamp) if known else step
        last_stamp = ping.stamp
        yield time, ping


class LogWriteError(OSError):
    """A ping could not be written; the file still ends with a complete ping."""


class DamagedPart(NamedTuple):
    """A part of a log that is not a ping: where it begins, its number of bytes, and what is wrong with it."""

    offset: int
    length: int
    reason: str

    def __str__(self) -> str:
        return f"{self.length} damaged bytes at byte {self.offset}: {self.reason}"


class LogReader:
    """Iterates once over the pings of a log; skips every damaged part up to the next complete ping.

    `ping_count` and `damages` are final after the last ping.
    """

    def __init__(self, path: Union[str, Path]) -> None:
        self.ping_count = 0
        self.damages: List[DamagedPart] = []
        with open(path, "rb") as file:
            empty = os.fstat(file.fileno()).st_size == 0
            self._data = b"" if empty else mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)

    def __iter__(self) -> Iterator[LoggedPing]:
        position, damage_start, reason = 0, None, ""
        while position < len(self._data):
            ping, end, problem = self._record_at(position)
            if ping is not None:
                self._note_damage(damage_start, position, reason)
                damage_start = None
                self.ping_count += 1
                yield ping
            if problem and damage_start is None:
                damage_start, reason = (position if ping is None else end), problem
            position = end
        self._note_damage(damage_start, len(self._data), reason)

    def _record_at(self, position: int) -> Tuple[Optional[LoggedPing], int, str]:
        """Return the ping at `position`, where to continue, and what is wrong there."""
        header = self._data[position : position + HEADER_LENGTH]
        try:
            kind = check_record_header(header)
            reply_end = position + HEADER_LENGTH + kind.length
            inner = self._next_header(position + 1, reply_end)
            if inner < reply_end:
                return None, inner, "a ping is cut short"
            ping = decode_record(self._data[position:reply_end])
        except FrameError as error:
            return None, self._next_header(position + 1, len(self._data)), str(error)
        end = position + _RECORD_LENGTHS[kind]
        fill = self._data[reply_end:end]
        zeros = len(fill) - len(fill.lstrip(b"\0"))
        # The zero fill ends early where the file was cut off.
        if reply_end + zeros < end:
            return ping, reply_end + zeros, "the zero fill of a ping is cut short"
        return ping, end, ""

    def _next_header(self, start: int, end: int) -> int:
        """Return where the next complete record header before `end` begins, or `end`."""
        while True:
            found = self._data.find(MAGIC, start, min(end + len(MAGIC), len(self._data)))
            if found < 0 or found >= end:
                return end
            try:
                check_record_header(self._data[found : found + HEADER_LENGTH])
                return found
            except FrameError:
                start = found + 1

    def _note_damage(self, start: Optional[int], end: int, reason: str) -> None:
        if start is not None:
            self.damages.append(DamagedPart(start, end - start, reason))


class LogWriter:
    """Appends pings to a log with one write each, so that the file always holds complete pings."""

    def __init__(self, path: Union[str, Path]) -> None:
        """Raises OSError if the file cannot be opened; its existing content is kept."""
        self._file = os.open(str(path), os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o644)
        self._path = path

    def __enter__(self) -> "LogWriter":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def write(self, ping: LoggedPing) -> None:
        """Append one ping.

        Raises FrameError for a ping that a record cannot hold and LogWriteError if it cannot be written completely.
        """
        record = ping.encode()
        length = os.fstat(self._file).st_size
        try:
            written = os.write(self._file, record)
        except OSError as error:
            os.ftruncate(self._file, length)
            raise LogWriteError(error.errno, f"{self._path}: {error.strerror}") from error
        if written != len(record):
            os.ftruncate(self._file, length)
            raise LogWriteError(f"{self._path}: only {written} of {len(record)} bytes could be written")

    def close(self) -> None:
        """Flush everything to the disk and close the file; closing twice is allowed."""
        if self._file < 0:
            return
        file, self._file = self._file, -1
        try:
            os.fsync(file)
        finally:
            os.close(file)
