"""Writes bags of ROS 1 without ROS."""

import struct
from pathlib import Path
from typing import Any, Dict, List, NamedTuple

import numpy as np
from rosbags.rosbag1 import Writer

from recordings.bags.message_types import blank_message, message_rows, ros1_types

COMPRESSIONS = ("none", "lz4", "bz2")
_MESSAGE_HEAD = struct.Struct(
    "<I I4s I5sI I5s"
)  # of a record: size, then the fields op, conn and time with their sizes
_TIME_AND_SIZE = struct.Struct("<III")  # the value of the field time, and the size of the message
_HEADER_SIZE = _MESSAGE_HEAD.size - 4 + 8  # without the size itself, and with the value of the field time


class _Replaced(type(Path())):
    """A file that rosbags writes although it is there: it was made, and locked, by whoever writes whole files."""

    def open(self, mode: str = "r", *arguments: Any, **options: Any) -> Any:
        """Open the file; one that must be new is emptied instead."""
        return super().open(mode.replace("x", "w"), *arguments, **options)


class _Topic(NamedTuple):
    """What is the same for all messages of a topic: its number, and the beginning of a message's record."""

    connection: int
    head: bytes


class PackedMessages(NamedTuple):
    """Messages of one topic that can be appended.

    connection: number of the topic. stamps_ns: of each message. records: the bytes of each in the file.
    """

    connection: int
    stamps_ns: List[int]
    records: List[bytes]


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
        return blank_message(ros1_types(), kind.replace("/", "/msg/"))

    def time(self, stamp_ns: int) -> Any:
        """Return a time for a header."""
        time = blank_message(ros1_types(), "builtin_interfaces/msg/Time")
        time.sec, time.nanosec = divmod(stamp_ns, 10**9)
        return time

    def write(self, topic: str, message: Any, stamp_ns: int) -> None:
        """Append a message, made by `make` or read from a bag of the same type. Raises OSError."""
        known = self._known(topic, message)
        data = ros1_types().serialize_ros1(message, message.__msgtype__)
        record = known.head + _TIME_AND_SIZE.pack(*divmod(stamp_ns, 10**9), len(data)) + data
        self._append(known.connection, record, stamp_ns)

    def pack(self, topic: str, message: Any, stamps_ns: np.ndarray) -> PackedMessages:
        """Return messages with stamps (n,) int64, ready to be appended; `message_rows` says how `message` holds them.

        Topics get their numbers in the order in which they are packed or written first.
        """
        known = self._known(topic, message)
        rows = message_rows(ros1_types(), message.__msgtype__, message, len(stamps_ns))
        start = len(known.head)
        records = np.empty((len(rows), start + _TIME_AND_SIZE.size + rows.shape[1]), np.uint8)
        records[:, :start] = np.frombuffer(known.head, np.uint8)
        seconds, nanoseconds = np.divmod(stamps_ns, 10**9)
        times = np.column_stack([seconds, nanoseconds, np.full(len(rows), rows.shape[1])]).astype("<u4")
        records[:, start : start + _TIME_AND_SIZE.size] = times.view(np.uint8)
        records[:, start + _TIME_AND_SIZE.size :] = rows
        return PackedMessages(known.connection, stamps_ns.tolist(), [record.tobytes() for record in records])

    def append(self, messages: PackedMessages, place: int) -> None:
        """Append the message at `place` of packed ones. Raises OSError."""
        self._append(messages.connection, messages.records[place], messages.stamps_ns[place])

    def _known(self, topic: str, message: Any) -> _Topic:
        known = self._topics.get(topic)
        if known is None:
            number = self._writer.add_connection(topic, message.__msgtype__, typestore=ros1_types()).id
            head = _MESSAGE_HEAD.pack(_HEADER_SIZE, 4, b"op=\x02", 9, b"conn=", number, 13, b"time=")
            known = self._topics[topic] = _Topic(number, head)
        return known

    def _append(self, connection: int, record: bytes, stamp_ns: int) -> None:
        """Do what rosbags's Writer.write does, without making the record's header anew for each message."""
        chunk = self._writer.chunks[-1]
        place = chunk.data.tell()
        chunk.connections[connection].append((stamp_ns, place))
        if stamp_ns < chunk.start:
            chunk.start = stamp_ns
        if stamp_ns > chunk.end:
            chunk.end = stamp_ns
        chunk.data.write(record)
        if place + len(record) > self._writer.chunk_threshold:
            self._writer.write_chunk(chunk)
