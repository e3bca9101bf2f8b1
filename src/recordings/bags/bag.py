"""Reads bags: ROS 1 files, and ROS 2 folders or single files (sqlite3, mcap)."""

from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, Tuple, Union

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.typesys.store import Typestore

from recordings.bags.message_types import defined_in, ros2_types
from recordings.bags.ros1_reader import Ros1Reader
from recordings.bags.single_file import LONE_FILES, folder_of
from recordings.errors import RecordingError


@dataclass(frozen=True)
class Topic:
    """name; type: package/Name, the same for ROS 1 and ROS 2; count: number of messages."""

    name: str
    type: str
    count: int


class Bag:
    """An open bag; a context manager. Everything raises RecordingError for a file that cannot be read."""

    def __init__(self, path: Path) -> None:
        """Raises RecordingError, also for a file that is no bag or was not closed."""
        self.path = path
        self._open = ExitStack()
        self._stores: Dict[Tuple[str, str], Typestore] = {}
        with _told(path), ExitStack() as stack:
            self._reader = _reader(path, stack)
            stack.enter_context(self._reader)
            self._open = stack.pop_all()

    def __enter__(self) -> "Bag":
        return self

    def __exit__(self, *exception: object) -> None:
        self._open.close()

    @property
    def is_ros2(self) -> bool:
        """Whether it was recorded with ROS 2."""
        return isinstance(self._reader, Ros2Reader)

    @property
    def topics(self) -> Dict[str, Topic]:
        """All topics by their names."""
        found: Dict[str, Topic] = {}
        for connection in self._reader.connections:
            before = found[connection.topic].count if connection.topic in found else 0
            found[connection.topic] = Topic(
                connection.topic, connection.msgtype.replace("/msg/", "/"), before + connection.msgcount
            )
        return found

    def messages(self, topic: str) -> Iterator[Tuple[int, Any]]:
        """Yield (time of recording [ns], message) of one topic, in the order of these times; none without the topic.

        One topic at a time: topics often lie in chunks of their own.
        """
        connections = [one for one in self._reader.connections if one.topic == topic]
        if not connections:
            return
        with _told(self.path):
            readers = {connection.id: self._deserializer(connection) for connection in connections}
            for connection, time, raw in self._reader.messages(connections):
                yield time, readers[connection.id](raw)

    def _deserializer(self, connection: Connection) -> Callable[[bytes], Any]:
        """Return what turns the bytes of a connection's messages into objects."""
        store = self._store_of(connection)
        if self.is_ros2:
            return lambda raw: store.deserialize_cdr(raw, connection.msgtype)
        return lambda raw: store.deserialize_ros1(raw, connection.msgtype)

    def _store_of(self, connection: Connection) -> Typestore:
        """Return the types of a topic alone: what other topics define wrongly, or otherwise, does not matter."""
        if not connection.msgdef:
            if connection.msgtype not in ros2_types().types:
                raise RecordingError(
                    f"{self.path}: {connection.topic} holds {connection.msgtype}, which the bag does not define; "
                    "record with ROS 2 Iron or newer, or into mcap"
                )
            return ros2_types()
        key = connection.msgtype, connection.msgdef
        if key not in self._stores:
            self._stores[key] = defined_in(connection.msgdef, connection.msgtype)
        return self._stores[key]


def _reader(path: Path, stack: ExitStack) -> Union[Ros1Reader, Ros2Reader]:
    if path.is_dir():
        return Ros2Reader(path)
    if path.suffix in LONE_FILES:
        return Ros2Reader(stack.enter_context(folder_of(path)))
    path.open("rb").close()
    return Ros1Reader(path)


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn what a damaged file leads to into one line: rosbags and its decompressors raise almost any error."""
    try:
        yield
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from None
    except Exception as error:
        if "not indexed" in str(error):
            told = f"{path}: not indexed, the recording was cut off; run: rosbag reindex {path}"
            raise RecordingError(told) from None
        raise RecordingError(f"{path}: not a bag, or damaged: {_one_line(error)}") from None


def _one_line(error: Exception) -> str:
    lines: List[str] = str(error).split()
    return " ".join(lines) or type(error).__name__
