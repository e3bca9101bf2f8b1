"""A single .mcap or .db3 file of a ROS 2 bag whose metadata.yaml is not there."""

import json
import sqlite3
from collections import Counter
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Dict, Iterator, List, Tuple

from rosbags.rosbag2.storage_mcap import MCAPFile

_TopicCount = Tuple[str, str, int]


@contextmanager
def folder_of(path: Path) -> Iterator[Path]:
    """Give a folder in which `path` is a whole bag. Raises OSError and what a damaged file leads to."""
    path.open("rb").close()
    storage, topics = ("mcap", _mcap_topics(path)) if path.suffix == ".mcap" else ("sqlite3", _sqlite_topics(path))
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / path.name).symlink_to(path.absolute())
        # JSON is YAML too.
        (folder / "metadata.yaml").write_text(json.dumps(_metadata(path.name, storage, topics)))
        yield folder


LONE_FILES = (".mcap", ".db3")


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
        "rosbag2_bagfile_information": {
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
