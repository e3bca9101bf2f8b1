"""Writes bags of ROS 1 without ROS."""

import struct
from pathlib import Path
from typing import Any, Dict, NamedTuple

from rosbags.rosbag1 import Writer

from recordings.bags.blank_message import blank_message
from recordings.bags.message_bytes import Write, serializer
from recordings.bags.message_types import ros1_types

COMPRESSIONS = ("none", "lz4", "bz2")
_MESSAGE_HEAD = struct.Struct(
    "<I I4s I5sI I5s"
)  # Of a record: size, then the fields op, conn and time with their sizes
_TIME_AND_SIZE = struct.Struct("<III")  # The value of the field time, and the size of the message
_HEADER_SIZE = _MESSAGE_HEAD.size - 4 + 8  # Without the size itself, and with the value of the field time


class _Replaced(type(Path())):
    """A file that rosbags writes although it is there: it was made, and locked, by whoever writes whole files."""

    def open(self, mode: str = "r", *arguments: Any, **options: Any) -> Any:
        """Open the file; one that must be new is emptied instead."""
        return super().open(mode.replace("x", "w"), *arguments, **options)


class _Topic(NamedTuple):
    """What is the same for all messages of a topic.

    connection: its number. head: the beginning of a message's record. to_bytes: turns a message into bytes.
    """

    connection: int
    head: bytes
    to_bytes: Write


class BagWriter:
    """An open bag; a context manager. What is at its path is replaced, so give it a file of `whole_file`."""

    def __init__(self, path: Path, compression: str = "none") -> None:
        """`compression`: one of COMPRESSIONS. Raises OSError."""
        # The constructor refuses a file that is there, and makes a plain path of any other.
        self._writer = Writer(path / "new")
        self._writer.path = _Replaced(path)
        if compression != "none":
            self._writer.set_compression(Writer.CompressionFormat[compression.upper()])
        self._topics: Dict[str, _Topic] = {}
        self._writer.open()

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(self, *exception: object) -> None:
        self._writer.close()

    def make(self, kind: str) -> Any:
        """Return a new message of the type package/Name with fields of zero. Raises KeyError for an unknown type."""
        return blank_message(ros1_types(), _ros2_name(kind))

    def time(self, stamp_ns: int) -> Any:
        """Return a time for a header."""
        time = blank_message(ros1_types(), "builtin_interfaces/msg/Time")
        time.sec, time.nanosec = divmod(stamp_ns, 10**9)
        return time

    def write(self, topic: str, message: Any, stamp_ns: int) -> None:
        """Append a message, made by `make` or read from a bag of the same type. Raises OSError."""
        known = self._topics.get(topic)
        if known is None:
            known = self._topics[topic] = self._added(topic, message.__msgtype__)
        self._append(known, known.to_bytes(message), stamp_ns)

    def _added(self, topic: str, kind: str) -> _Topic:
        number = self._writer.add_connection(topic, kind, typestore=ros1_types()).id
        return _Topic(
            number,
            _MESSAGE_HEAD.pack(_HEADER_SIZE, 4, b"op=\x02", 9, b"conn=", number, 13, b"time="),
            serializer(ros1_types(), kind),
        )

    def _append(self, topic: _Topic, data: bytes, stamp_ns: int) -> None:
        """Do what rosbags's Writer.write does, without making the record's header anew for each message."""
        chunk = self._writer.chunks[-1]
        place = chunk.data.tell()
        chunk.connections[topic.connection].append((stamp_ns, place))
        if stamp_ns < chunk.start:
            chunk.start = stamp_ns
        if stamp_ns > chunk.end:
            chunk.end = stamp_ns
        record = topic.head + _TIME_AND_SIZE.pack(*divmod(stamp_ns, 10**9), len(data)) + data
        chunk.data.write(record)
        if place + len(record) > self._writer.chunk_threshold:
            self._writer.write_chunk(chunk)


def _ros2_name(kind: str) -> str:
    package, _, name = kind.partition("/")
    return f"{package}/msg/{name}"
