"""Ping Viewer's binary log: a header, and then what came over the line, each part with its time.

Source: "Binary log file structure" of Ping Viewer, and its src/link/filelink.cpp and logsensorstruct.cpp. Qt writes
numbers big-endian, texts as their number of bytes and UTF-16. Times are hours, minutes, seconds and milliseconds since
Ping Viewer was started; older versions wrote the time of day.
"""

import re
import struct
from dataclasses import dataclass
from typing import Iterator, Optional, Tuple

TITLE = "PingViewer sensor log file"

_BUILD_TEXTS = 5  # Commit, date, release, name and version of the operating system
_NULL_TEXT = 0xFFFFFFFF
_LONGEST_PART = 10240  # Bytes, the buffer of Ping Viewer's parser
_DAY = 86400.0
_TIME = re.compile(r"(\d\d):([0-5]\d):([0-5]\d)\.(\d\d\d)")
_TIME_LENGTH = 28  # Bytes of the next pattern
_TIME_BYTES = re.compile(rb"\0\0\0\x18\0\d\0\d\0:\0[0-5]\0\d\0:\0[0-5]\0\d\0\.\0\d\0\d\0\d")


class NoLogError(ValueError):
    """Bytes that are no log of Ping Viewer."""


@dataclass(frozen=True)
class LoggedPart:
    """Bytes that came at `time`, s since the start of Ping Viewer or, in old logs, of the day; never decreasing."""

    time: float
    data: bytes


class PingViewerLog:
    """Iterates over the parts of a log; skips what is damaged up to the next time. `damaged` counts such places."""

    def __init__(self, data: bytes) -> None:
        """`data`: the whole file. Raises NoLogError."""
        self.damaged = 0
        self._data = data
        try:
            title, position = _text(data, 0)
            if title != TITLE:
                raise NoLogError(f"begins with {title[:40]!r}: must be {TITLE!r}")
            self.version, position = _number(data, position)
            for _ in range(_BUILD_TEXTS):
                _, position = _text(data, position)
            self._start = position + 2 * 4
        except (struct.error, UnicodeDecodeError):
            raise NoLogError(f"{len(data)} bytes: the header is cut short or damaged") from None

    def __iter__(self) -> Iterator[LoggedPart]:
        position, last, days = self._start, 0.0, 0
        while position < len(self._data):
            part, position = self._part(position)
            if part is not None:
                if part.time + days * _DAY < last - _DAY / 2:
                    days += 1
                last = max(last, part.time + days * _DAY)
                yield LoggedPart(last, part.data)

    def _is_cut(self, start: int, end: int) -> bool:
        """Return whether another part begins within the data of one: its own end is lost."""
        inner = _TIME_BYTES.search(self._data, start, end + _TIME_LENGTH)
        return inner is not None and inner.start() < end

    def _part(self, position: int) -> Tuple[Optional[LoggedPart], int]:
        """Return the part at `position`, if there is one, and where to continue."""
        try:
            text, after = _text(self._data, position)
            (length,) = struct.unpack_from(">I", self._data, after)
            end = after + 4 + length
            time = _seconds(text)
            if time is not None and length <= _LONGEST_PART and end <= len(self._data) and not self._is_cut(after, end):
                return LoggedPart(time, self._data[after + 4 : end]), end
        except (struct.error, UnicodeDecodeError):
            pass
        self.damaged += 1
        following = _TIME_BYTES.search(self._data, position + 1)
        return None, following.start() if following else len(self._data)


def _seconds(text: str) -> Optional[float]:
    found = _TIME.fullmatch(text)
    if found is None:
        return None
    hours, minutes, seconds, milliseconds = map(int, found.groups())
    return 3600.0 * hours + 60.0 * minutes + seconds + 1e-3 * milliseconds


def _number(data: bytes, position: int) -> Tuple[int, int]:
    return struct.unpack_from(">i", data, position)[0], position + 4


def _text(data: bytes, position: int) -> Tuple[str, int]:
    """Return the text at `position` and where it ends; raises struct.error where it is cut short."""
    (length,) = struct.unpack_from(">I", data, position)
    if length == _NULL_TEXT:
        return "", position + 4
    (raw,) = struct.unpack_from(f">{min(length, len(data))}s", data, position + 4)
    return raw.decode("utf-16-be"), position + 4 + length
