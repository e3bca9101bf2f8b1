"""Finds replies in a stream of bytes, however the stream is split and whatever is between the replies."""

import re
from typing import List, NamedTuple, Optional

from imagenex_852_driver.protocol.reply import HEAD_IDS, HEADER_LENGTH, FrameError, Reply, ReplyKind, check_header

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
            kind = self._announced()
            if kind is None:
                self._skip(1)
                continue
            inner = self._inner_header(kind.length)
            if inner is not None:
                self._skip(inner)
            elif len(self._buffer) < kind.length:
                break
            else:
                found.extend(self._take(kind))
        return found

    def reset(self) -> None:
        """Give up waiting for the rest of a reply and count positions from zero again."""
        self._buffer.clear()
        self._offset = 0

    def _announced(self) -> Optional[ReplyKind]:
        """Return the kind of the reply at the front, None when its header is corrupt."""
        if len(self._buffer) >= HEADER_LENGTH and not _is_header(self._buffer):
            return None
        return ReplyKind(bytes(self._buffer[:3]))

    def _take(self, kind: ReplyKind) -> List[ParsedReply]:
        try:
            parsed = ParsedReply(self._offset, Reply.decode(bytes(self._buffer[: kind.length])))
        except FrameError:
            self._skip(1)
            return []
        self._skip(kind.length)
        return [parsed]

    def _inner_header(self, length: int) -> Optional[int]:
        """Return where another reply begins inside the one at the front, whose own end was then lost."""
        for match in _LETTERS.finditer(self._buffer, 1, length):
            header = self._buffer[match.start() : min(match.start() + HEADER_LENGTH, length)]
            if _is_header(header) or self._is_cut_header(header, length):
                return match.start()
        return None

    def _is_cut_header(self, header: bytes, length: int) -> bool:
        """Return whether the last bytes of a complete reply look like a header that continues after it.

        The status byte of the next reply can look like the terminator of this one.
        """
        return len(self._buffer) >= length and _STATUS < len(header) < HEADER_LENGTH and header[3] in HEAD_IDS

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
