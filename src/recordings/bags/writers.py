"""Writes bags of ROS 1, and MCAP files of ROS 2 with their message types, which Foxglove opens; without ROS."""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Dict

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer

from node_support.errors import needed
from recordings.bags.bag import RecordingError
from recordings.bags.message_types import StoreMessages, ros1_types, ros2_types

COMPRESSIONS = ("none", "lz4", "bz2")


class _Replaced(type(Path())):
    """A file that rosbags writes although it is there: it was made, and locked, by whoever writes whole files."""

    def open(self, mode: str = "r", *arguments: Any, **options: Any) -> Any:
        """Open the file; one that must be new is emptied instead."""
        return super().open(mode.replace("x", "w"), *arguments, **options)


class BagWriter(StoreMessages, AbstractContextManager):
    """An open bag. What is at its path is replaced, so give it a file of `whole_file`."""

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

    def __exit__(self, *exception: object) -> None:
        self._writer.close()

    def write(self, topic: str, message: Any, stamp_ns: int) -> None:
        """Append a message, made by `make` or read from a bag of the same type. Raises OSError."""
        kind = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, kind, typestore=ros1_types())
        self._writer.write(self._connections[topic], stamp_ns, ros1_types().serialize_ros1(message, kind))


def mcap_writer() -> Any:
    """Return the library's class of writers. Raises RecordingError where it is not installed."""
    return needed("mcap.writer", "pip install mcap", lambda text: RecordingError(f"MCAP: {text}")).Writer


class McapWriter(StoreMessages, AbstractContextManager):
    """An open file, used as BagWriter. What is at its path is replaced."""

    def __init__(self, path: Path) -> None:
        """Raises OSError, and RecordingError without the library."""
        super().__init__(ros2_types())
        self._writer = mcap_writer()(str(path))
        self._writer.start(profile="ros2", library="underwater_map_construction")
        self._channels: Dict[str, int] = {}
        self._schemas: Dict[str, int] = {}

    def __exit__(self, *exception: object) -> None:
        self._writer.finish()

    def write(self, topic: str, message: Any, stamp_ns: int) -> None:
        """Append a message made by `make`. Raises OSError."""
        kind = message.__msgtype__
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schema(kind))
        data = bytes(ros2_types().serialize_cdr(message, kind))
        self._writer.add_message(self._channels[topic], stamp_ns, data, stamp_ns)

    def _schema(self, kind: str) -> int:
        if kind not in self._schemas:
            definition = ros2_types().generate_msgdef(kind, ros_version=2)[0].encode()
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", definition)
        return self._schemas[kind]
