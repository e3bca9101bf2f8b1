"""Ping Viewer's binary log: a header, and then what came over the line, each part with its time.

Source: "Binary log file structure" of Ping Viewer, and its src/link/filelink.cpp and logsensorstruct.cpp. Qt writes
numbers big-endian, texts as their number of bytes and UTF-16. Times are hours, minutes, seconds and milliseconds since
Ping Viewer was started; older versions wrote the time of day, and the first ones no header. Qt writes times with the
digits and signs of the computer's language.
"""

import re
import struct
import unicodedata
from dataclasses import dataclass
from typing import Iterator, Optional, Tuple

TITLE = "PingViewer sensor log file"

_BEGINNING = struct.pack(">I", 2 * len(TITLE)) + TITLE.encode("utf-16-be")
_BUILD_TEXTS = 5  # Commit, date, release, name and version of the operating system
_NULL = 0xFFFFFFFF  # Length of a text or of data that Qt calls null
_LONGEST_PART = 10240  # Bytes, the buffer of Ping Viewer's parser; a log holds longer ones where the computer was busy
_HALF_DAY = 12 * 3600.0  # s
_BACK = 11 * 3600.0  # s: a clock that goes back by more began a new half of a day, in a language not known here
_SET_BACK = 1.0  # s: one that goes back by more was set
# Hours, minutes and seconds with the same sign between them, and milliseconds, which a date beside them does not have.
_CLOCK = re.compile(r"(?<!\d)(\d{1,2})([^\d\s])([0-5]\d)\2([0-5]\d)\D(\d{3})(?!\d)")
_AFTERNOON = {"pm", "بظ", "بعدازظهر", "م", "下午", "午後", "오후", "μμ"}
_MORNING = {"am", "قظ", "قبلازظهر", "ص", "上午", "午前", "오전", "πμ"}
# The length of a text of 8 to 40 characters, with which each part begins.
_TEXT_LENGTH = re.compile(rb"(?=\0\0\0[\x10-\x50])")
_LONGEST_TEXT = 0x50  # Bytes


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
        self._start = 0 if self._time(0) is not None else self._first_part()

    def __iter__(self) -> Iterator[LoggedPart]:
        position, last, shift = self._start, 0.0, 0.0
        while position < len(self._data):
            part, position = self._part(position)
            if part is not None:
                while part.time + shift < last - _BACK:
                    shift += _HALF_DAY
                if part.time + shift < last - _SET_BACK:
                    shift = last - part.time
                last = max(last, part.time + shift)
                yield LoggedPart(last, part.data)

    def _first_part(self) -> int:
        """Return where the first part begins, also where what stood before it is damaged or lost. Raises NoLogError."""
        try:
            return _after_header(self._data)
        except NoLogError:
            first = self._next_time(0, min(len(self._data), 2 * _LONGEST_PART))
            self.damaged += 1
            if first is None and not self._data.startswith(_BEGINNING):
                raise
            return len(self._data) if first is None else first

    def _part(self, position: int) -> Tuple[Optional[LoggedPart], int]:
        """Return the part at `position`, if there is one, and where to continue."""
        found = self._time(position)
        if found is not None:
            time, start = found
            end = start + _length(self._data, start - 4)
            # Where another part begins within the data of one, or with their length, its own end is lost.
            if end <= len(self._data) and self._next_time(start - 4, end) is None:
                return LoggedPart(time, self._data[start:end]), end
        self.damaged += 1
        following = self._next_time(position + 1, len(self._data))
        return None, len(self._data) if following is None else following

    def _next_time(self, start: int, end: int) -> Optional[int]:
        """Return where from `start` on, and before `end`, the next part begins."""
        places = (one.start() for one in _TEXT_LENGTH.finditer(self._data, start, end + 3))
        return next((place for place in places if self._time(place) is not None), None)

    def _time(self, position: int) -> Optional[Tuple[float, int]]:
        """Return the time [s] of the part that begins at `position` and where its data begin; None where none does."""
        try:
            length = _length(self._data, position)
            if length > _LONGEST_TEXT:
                return None
            text, after = _text(self._data, position)
            _length(self._data, after)
        except (struct.error, UnicodeDecodeError):
            return None
        # A text that began a few bytes too early, in data that end with zeros, holds the length of the true one.
        time = None if "\0" in text else _seconds(text)
        return None if time is None else (time, after + 4)


def _after_header(data: bytes) -> int:
    """Return where a header at the start of `data` ends. Raises NoLogError."""
    try:
        title, position = _text(data, 0)
        if title != TITLE:
            raise NoLogError(f"begins with {title[:40]!r}: must be {TITLE!r}")
        position += 4  # Version of the header
        for _ in range(_BUILD_TEXTS):
            _, position = _text(data, position)
    except (struct.error, UnicodeDecodeError):
        raise NoLogError(f"{len(data)} bytes: the header is cut short or damaged") from None
    return position + 2 * 4  # Family and type of the device


def _seconds(text: str) -> Optional[float]:
    """Return the time of day or since the start in a text of any language [s], None where there is none."""
    plain = "".join(str(unicodedata.decimal(one, one)) for one in text if unicodedata.category(one) != "Cf")
    found = _CLOCK.search(plain)
    if found is None:
        return None
    hours, minutes, seconds, milliseconds = (int(found[group]) for group in (1, 3, 4, 5))
    letters = "".join(filter(str.isalpha, plain[: found.start()] + plain[found.end() :])).casefold()
    if letters in _AFTERNOON | _MORNING:
        hours = hours % 12 + 12 * (letters in _AFTERNOON)
    return 3600.0 * hours + 60.0 * minutes + seconds + 1e-3 * milliseconds


def _length(data: bytes, position: int) -> int:
    """Return the number of bytes that is written at `position`. Raises struct.error where it is cut short."""
    (length,) = struct.unpack_from(">I", data, position)
    return 0 if length == _NULL else length


def _text(data: bytes, position: int) -> Tuple[str, int]:
    """Return the text at `position` and where it ends; raises struct.error where it is cut short."""
    length = _length(data, position)
    (raw,) = struct.unpack_from(f">{min(length, len(data))}s", data, position + 4)
    return raw.decode("utf-16-be"), position + 4 + length
