"""Reads, plays and appends to the manufacturer's `.852` logs."""

import mmap
import os
from pathlib import Path
from typing import Iterable, Iterator, List, NamedTuple, Optional, Tuple, Union

from imagenex_852_driver.log_record import (
    HEADER_LENGTH,
    MAGIC,
    LoggedPing,
    check_record_header,
    decode_record,
    record_length,
)
from imagenex_852_driver.protocol.reply import FrameError

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
        return self._after_fill(ping, reply_end, position + record_length(kind))

    def _after_fill(self, ping: LoggedPing, start: int, end: int) -> Tuple[LoggedPing, int, str]:
        """Skip the zero fill after a ping; it ends early where the file was cut off."""
        fill = self._data[start:end]
        zeros = len(fill) - len(fill.lstrip(b"\0"))
        if start + zeros < end:
            return ping, start + zeros, "the zero fill of a ping is cut short"
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
