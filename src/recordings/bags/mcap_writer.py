"""Writes MCAP files of ROS 2, whose message types stand in them: Foxglove opens them without any package."""

from pathlib import Path
from typing import Any, Dict

from recordings.bags.bag import RecordingError
from recordings.bags.message_types import blank_message, ros2_types


def mcap_writer() -> Any:
    """Return the library's class of writers. Raises RecordingError where it is not installed."""
    try:
        from mcap.writer import Writer
    except ImportError:
        raise RecordingError("MCAP files need the library mcap; install it with: pip install mcap") from None
    return Writer


class McapWriter:
    """An open file; a context manager, used as BagWriter. What is at its path is replaced."""

    def __init__(self, path: Path) -> None:
        """Raises OSError, and RecordingError without the library."""
        self._writer = mcap_writer()(str(path))
        self._writer.start(profile="ros2", library="underwater_map_construction")
        self._channels: Dict[str, int] = {}
        self._schemas: Dict[str, int] = {}

    def __enter__(self) -> "McapWriter":
        return self

    def __exit__(self, *exception: object) -> None:
        self._writer.finish()

    def make(self, kind: str) -> Any:
        """Return a new message of the type package/Name with fields of zero. Raises KeyError for an unknown type."""
        return blank_message(ros2_types(), kind.replace("/", "/msg/"))

    def time(self, stamp_ns: int) -> Any:
        """Return a time for a header."""
        time = blank_message(ros2_types(), "builtin_interfaces/msg/Time")
        time.sec, time.nanosec = divmod(stamp_ns, 10**9)
        return time

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
