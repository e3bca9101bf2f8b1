"""Reads bags: ROS 1 files, and ROS 2 folders or single files (sqlite3, mcap)."""

import json
import sqlite3
from collections import Counter
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Callable, Dict, Iterable, Iterator, List, Tuple, Union

import yaml
from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.rosbag2.storage_mcap import MCAPFile
from rosbags.typesys.store import Typestore

from recordings.bags.message_types import defined_in, ros2_types

_LONE_FILES = (".mcap", ".db3")
_METADATA, _INFORMATION = "metadata.yaml", "rosbag2_bagfile_information"
_NEWEST_VERSION = 8  # of metadata that rosbags 0.9.23 reads; ROS 2 Jazzy writes 9
_PACKED = (
    (b"\x1f\x8b", "gzip", "gunzip --keep"),
    (b"BZh", "bzip2", "bunzip2 --keep"),
    (b"PK\x03\x04", "zip", "unzip"),
    (b"\xfd7zXZ", "xz", "unxz --keep"),
    (b"\x28\xb5\x2f\xfd", "zstd", "zstd -d"),
)
"""First bytes, program and command of packed files."""
_TopicCount = Tuple[str, str, int]


class RecordingError(ValueError):
    """A recording cannot be used; the text is one line that says which, why and what to do."""


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
        with _in_one_line(path), ExitStack() as stack:
            self._reader = _reader(path, stack)
            stack.enter_context(self._reader)
            self.topics = _topics(self._reader.connections)
            """All topics by their names."""
            self._open = stack.pop_all()

    def __enter__(self) -> "Bag":
        return self

    def __exit__(self, *exception: object) -> None:
        self._open.close()

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
                yield time, readers[connection.id](raw)

    def _deserializer(self, connection: Connection) -> Callable[[bytes], Any]:
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
    if path.is_dir():
        return Ros2Reader(stack.enter_context(_readable_folder(path)))
    if path.suffix in _LONE_FILES:
        return Ros2Reader(stack.enter_context(_folder_of(path)))
    path.open("rb").close()
    return Ros1Reader(path)


@contextmanager
def _readable_folder(path: Path) -> Iterator[Path]:
    """Give a folder that rosbags reads: `path`, or one with its files and metadata of the newest version it knows.

    What newer versions tell otherwise, as of the quality of service, is not read here.
    """
    try:
        metadata = yaml.safe_load((path / _METADATA).read_text())
        is_newer = metadata[_INFORMATION]["version"] > _NEWEST_VERSION
    except (OSError, yaml.YAMLError, KeyError, TypeError):
        is_newer = False  # The reader says what is wrong
    if not is_newer:
        yield path
        return
    metadata[_INFORMATION]["version"] = _NEWEST_VERSION
    with TemporaryDirectory() as name:
        folder = Path(name)
        for file in path.iterdir():
            if file.name != _METADATA:
                (folder / file.name).symlink_to(file.absolute())
        (folder / _METADATA).write_text(yaml.safe_dump(metadata))
        yield folder


@contextmanager
def _folder_of(path: Path) -> Iterator[Path]:
    """Give a folder in which `path`, a file whose metadata.yaml is not there, is a whole bag.

    Raises OSError and what a damaged file leads to.
    """
    path.open("rb").close()
    storage, topics = ("mcap", _mcap_topics(path)) if path.suffix == ".mcap" else ("sqlite3", _sqlite_topics(path))
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / path.name).symlink_to(path.absolute())
        # JSON is YAML too.
        (folder / _METADATA).write_text(json.dumps(_metadata(path.name, storage, topics)))
        yield folder


def _mcap_topics(path: Path) -> List[_TopicCount]:
    file = MCAPFile(path)
    file.open()
    try:
        if not file.channels:
            file.meta_scan()
        counts: Counter = Counter()
        for chunk in file.chunks:
            counts.update(chunk.channel_count)
        return [(one.topic, one.schema, counts[one.id]) for one in file.channels.values()]
    finally:
        file.close()


def _sqlite_topics(path: Path) -> List[_TopicCount]:
    query = "SELECT name, type, (SELECT COUNT(*) FROM messages WHERE topic_id = topics.id) FROM topics ORDER BY id"
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True)) as database:
        return database.execute(query).fetchall()


def _metadata(file: str, storage: str, topics: List[_TopicCount]) -> Dict[str, Any]:
    counted = [
        {
            "topic_metadata": {"name": name, "type": kind, "serialization_format": "cdr", "offered_qos_profiles": ""},
            "message_count": count,
        }
        for name, kind, count in topics
    ]
    return {
        _INFORMATION: {
            "version": 5,
            "storage_identifier": storage,
            "relative_file_paths": [file],
            "duration": {"nanoseconds": 0},
            "starting_time": {"nanoseconds_since_epoch": 0},
            "message_count": sum(count for _, _, count in topics),
            "topics_with_message_count": counted,
            "compression_format": "",
            "compression_mode": "",
        }
    }


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
        advice = _advice(path, str(error))
        if advice:
            raise RecordingError(f"{path}: {advice}{_files_instead(path)}") from None
        detail = " ".join(str(error).split()) or type(error).__name__
        raise RecordingError(f"{path}: not a bag, or damaged: {detail}{_files_instead(path)}") from None


def _advice(path: Path, error: str) -> str:
    """Return what a file is that rosbags refused with `error`, and how to get at its messages; empty: not known."""
    if path.is_dir():
        is_whole = (path / _METADATA).exists()
        return "" if is_whole else f"no {_METADATA}, the recording was not ended; run: ros2 bag reindex {path}"
    with path.open("rb") as file:
        start = file.read(8)
    for magic, packer, unpack in _PACKED:
        if start.startswith(magic):
            return f"packed with {packer}; unpack it first: {unpack} {path}"
    if any(sign in error for sign in ("not indexed", "index looks damaged")):
        return f"not indexed, the recording was cut off; run: rosbag reindex {path}"
    if "end magic" in error:
        return f"the recording was cut off; run: mcap recover {path} -o recovered.mcap"
    return ""


def _files_instead(path: Path) -> str:
    """Return in words which single file of a folder may be readable, empty where there is none."""
    files = sorted(str(file) for file in path.glob("*") if file.suffix in _LONE_FILES) if path.is_dir() else []
    return f"; a file of it may open by itself: {' or '.join(files)}" if files else ""
