"""Reads bags: ROS 1 files, and ROS 2 folders or single files (sqlite3, mcap)."""

from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Dict, Iterable, Iterator, List, Tuple, Union

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader as Ros2Reader

from recordings.bags.message_types import defined_in, ros2_types
from recordings.bags.ros1_reader import Ros1Reader
from recordings.bags.ros2_folder import STORAGES, is_cut, readable_folder

_PACKED = (
    (b"\x1f\x8b", "gzip", "gunzip --keep"),
    (b"BZh", "bzip2", "bunzip2 --keep"),
    (b"PK\x03\x04", "zip", "unzip"),
    (b"\xfd7zXZ", "xz", "unxz --keep"),
    (b"\x28\xb5\x2f\xfd", "zstd", "zstd -d"),
)  # first bytes, program and command of packed files


class RecordingError(ValueError):
    """A recording cannot be used; the text is one line that says which, why and what to do."""


def first_bytes(path: Path, count: int) -> bytes:
    """Return how a file begins; nothing of one that cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(count)
    except OSError:
        return b""


@dataclass(frozen=True)
class Topic:
    """name; type: package/Name, the same for ROS 1 and ROS 2; count: number of messages."""

    name: str
    type: str
    count: int


class Bag(AbstractContextManager):
    """An open bag. Everything raises RecordingError for a file that cannot be read."""

    def __init__(self, path: Path) -> None:
        """Raises RecordingError, also for a file that is no bag."""
        self.path = path
        with _in_one_line(path), ExitStack() as stack:
            self._reader = _reader(path, stack)
            stack.enter_context(self._reader)
            self.topics = _topics(self._reader.connections)
            """All topics by their names."""
            self._open = stack.pop_all()

    def __exit__(self, *exception: object) -> None:
        self._open.close()

    @property
    def notes(self) -> List[str]:
        """What whoever reads the bag should know, in sentences."""
        was_cut = is_cut(self.path) if self.is_ros2 else self._reader.is_cut
        return ["the recording was cut off; it is read up to there"] if was_cut else []

    @property
    def is_ros2(self) -> bool:
        return isinstance(self._reader, Ros2Reader)

    def messages(self, topic: str) -> Iterator[Tuple[int, Any]]:
        """Yield (time of recording [ns], message) of one topic, in the order of these times; none without the topic.

        One topic at a time: topics often lie in chunks of their own.
        """
        connections = [one for one in self._reader.connections if one.topic == topic]
        if not connections:
            return
        with _in_one_line(self.path):
            readers = {connection.id: self._deserializer(connection) for connection in connections}
            for connection, time, raw in self._reader.messages(connections):
                if not isinstance(time, int):  # sqlite holds anything anywhere
                    raise RecordingError(f"{self.path}: damaged: a message of {topic} was recorded at {time!r}")
                yield time, readers[connection.id](raw, connection.msgtype)

    def _deserializer(self, connection: Connection) -> Callable[[bytes, str], Any]:
        """Return what reads a topic, by its types alone: what others define wrongly, or otherwise, does not matter."""
        if not connection.msgdef and connection.msgtype not in ros2_types().types:
            raise RecordingError(
                f"{self.path}: {connection.topic} holds {connection.msgtype}, which the bag does not define; "
                "record with ROS 2 Iron or newer, or into mcap"
            )
        store = defined_in(connection.msgdef, connection.msgtype) if connection.msgdef else ros2_types()
        return store.deserialize_cdr if self.is_ros2 else store.deserialize_ros1


def _topics(connections: Iterable[Connection]) -> Dict[str, Topic]:
    topics: Dict[str, Topic] = {}
    for one in connections:
        before = topics[one.topic].count if one.topic in topics else 0
        topics[one.topic] = Topic(one.topic, one.msgtype.replace("/msg/", "/"), before + one.msgcount)
    return topics


def missing_topic(topic: str, bags: Iterable[Bag]) -> RecordingError:
    """Return the error that says which topics there are instead."""
    names = ", ".join(sorted({name for bag in bags for name in bag.topics}))
    return RecordingError(f"no topic {topic}; there are {names or 'none at all'}")


def _reader(path: Path, stack: ExitStack) -> Union[Ros1Reader, Ros2Reader]:
    if path.is_dir() or path.suffix in STORAGES:
        return Ros2Reader(stack.enter_context(readable_folder(path)))
    path.open("rb").close()
    return Ros1Reader(path)


@contextmanager
def _in_one_line(path: Path) -> Iterator[None]:
    """Turn what a damaged file leads to into one line: rosbags and its decompressors raise almost any error."""
    try:
        yield
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from None
    except Exception as error:
        packed = "" if path.is_dir() else _packed(path)
        detail = " ".join(str(error).split()) or type(error).__name__
        raise RecordingError(f"{path}: {packed or f'not a bag, or damaged: {detail}'}") from None


def _packed(path: Path) -> str:
    """Return which program packed a file, and how to unpack it; empty: none that is known."""
    for magic, packer, unpack in _PACKED:
        if first_bytes(path, len(magic)) == magic:
            return f"packed with {packer}; unpack it first: {unpack} {path}"
    return ""
