"""Writes bags of ROS 1 without ROS."""

from pathlib import Path
from typing import Any, Dict

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer

from recordings.bags.message_types import StoreMessages, ros1_types

COMPRESSIONS = ("none", "lz4", "bz2")


class _Replaced(type(Path())):
    """A file that rosbags writes although it is there: it was made, and locked, by whoever writes whole files."""

    def open(self, mode: str = "r", *arguments: Any, **options: Any) -> Any:
        """Open the file; one that must be new is emptied instead."""
        return super().open(mode.replace("x", "w"), *arguments, **options)


class BagWriter(StoreMessages):
    """An open bag; a context manager. What is at its path is replaced, so give it a file of `whole_file`."""

    def __init__(self, path: Path, compression: str = "none") -> None:
        """`compression`: one of COMPRESSIONS. Raises OSError."""
        super().__init__(ros1_types())
        # The constructor refuses a file that is there, and makes a plain path of any other.
        self._writer = Writer(path / "new")
        self._writer.path = _Replaced(path)
        if compression != "none":
            self._writer.set_compression(Writer.CompressionFormat[compression.upper()])
        self._connections: Dict[str, Connection] = {}
        self._writer.open()

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(self, *exception: object) -> None:
        self._writer.close()

    def write(self, topic: str, message: Any, stamp_ns: int) -> None:
        """Append a message, made by `make` or read from a bag of the same type. Raises OSError."""
        kind = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, kind, typestore=ros1_types())
        self._writer.write(self._connections[topic], stamp_ns, ros1_types().serialize_ros1(message, kind))
