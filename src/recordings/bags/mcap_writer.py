"""Writes MCAP files of ROS 2, whose message types stand in them: Foxglove opens them without any package."""

from pathlib import Path
from typing import Any, Dict

from recordings.bags.bag import RecordingError
from recordings.bags.message_types import StoreMessages, ros2_types


def mcap_writer() -> Any:
    """Return the library's class of writers. Raises RecordingError where it is not installed."""
    try:
        from mcap.writer import Writer
    except ImportError:
        raise RecordingError("MCAP files need the library mcap; install it with: pip install mcap") from None
    return Writer


class McapWriter(StoreMessages):
    """An open file; a context manager, used as BagWriter. What is at its path is replaced."""

    def __init__(self, path: Path) -> None:
        """Raises OSError, and RecordingError without the library."""
        super().__init__(ros2_types())
        self._writer = mcap_writer()(str(path))
        self._writer.start(profile="ros2", library="underwater_map_construction")
        self._channels: Dict[str, int] = {}
        self._schemas: Dict[str, int] = {}

    def __enter__(self) -> "McapWriter":
        return self

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
