"""Makes a folder that the library reads of whatever a recording of ROS 2 consists of."""

import json
import sqlite3
from collections import Counter
from contextlib import closing, contextmanager
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryDirectory
from typing import Any, Dict, Iterator, List, Optional

import yaml
from rosbags.interfaces import Connection
from rosbags.rosbag2.storage_mcap import MCAPFile

STORAGES = {".mcap": "mcap", ".db3": "sqlite3"}
METADATA, _INFORMATION = "metadata.yaml", "rosbag2_bagfile_information"
_NEWEST_VERSION = 8  # of metadata that rosbags 0.9.23 reads; ROS 2 Jazzy writes 9
MAGIC, _FOOTER = b"\x89MCAP0\r\n", 2
_NO_SUMMARY = bytes([_FOOTER, 20]) + bytes(7 + 20) + MAGIC
_RECORDS = range(1, 16)  # of MCAP, by their numbers


@contextmanager
def readable_folder(path: Path) -> Iterator[Path]:
    """Give a folder that rosbags reads as a whole bag: `path`, or one with links to its files and metadata of its own.

    path: a folder, or a file of one of STORAGES by itself. What newer versions tell otherwise, as of the quality of
    service, is not read. Raises OSError and what a damaged file leads to.
    """
    metadata = _metadata_of(path)
    if metadata is not None and metadata["version"] <= _NEWEST_VERSION:
        yield path
        return
    files = [file for file in path.iterdir() if file.name != METADATA] if path.is_dir() else [path]
    with TemporaryDirectory() as name:
        folder = Path(name)
        links = [_link_to(file.absolute(), folder) for file in files]
        if metadata is None:
            # .._2 comes before .._10.
            links.sort(key=lambda link: (len(link.name), link.name))
            metadata = _counted([link for link in links if link.suffix in STORAGES])
        # JSON is YAML too.
        (folder / METADATA).write_text(json.dumps({_INFORMATION: {**metadata, "version": _NEWEST_VERSION}}))
        yield folder


def is_cut(path: Path) -> bool:
    """Return whether a recording was never ended: a folder without metadata, or an MCAP file without its end."""
    return _metadata_of(path) is None if path.is_dir() else path.suffix == ".mcap" and not _is_ended(path)


def _metadata_of(path: Path) -> Optional[Dict[str, Any]]:
    """Return what metadata.yaml tells of a folder; None where it is not there, as before a recording ends."""
    try:
        metadata = yaml.safe_load((path / METADATA).read_text())[_INFORMATION]
        return metadata if isinstance(metadata["version"], int) and metadata["relative_file_paths"] else None
    except (OSError, ValueError, yaml.YAMLError, KeyError, TypeError):
        return None


def _link_to(file: Path, folder: Path) -> Path:
    """Return a link in `folder` to a file. An MCAP file that was cut off is copied there instead, and ended."""
    link = folder / file.name
    if file.suffix != ".mcap" or _is_ended(file):
        link.symlink_to(file)
        return link
    with file.open("rb") as source, link.open("wb") as copy:
        copyfileobj(source, copy)
        copy.truncate(_end_of_whole_records(file))
        copy.seek(0, 2)
        copy.write(_NO_SUMMARY)
    return link


def _is_ended(file: Path) -> bool:
    with file.open("rb") as opened:
        opened.seek(max(file.stat().st_size - len(MAGIC), 0))
        return opened.read() == MAGIC


def _end_of_whole_records(file: Path) -> int:
    """Return how many bytes of an MCAP file are whole records of its data."""
    size, end = file.stat().st_size, len(MAGIC)
    with file.open("rb") as opened:
        while True:
            opened.seek(end)
            head = opened.read(9)
            after = end + 9 + int.from_bytes(head[1:], "little")
            if len(head) < 9 or head[0] not in _RECORDS or head[0] == _FOOTER or after > size:
                return end
            end = after


def _counted(files: List[Path]) -> Dict[str, Any]:
    """Return the metadata of a bag with these files."""
    if not files:
        raise FileNotFoundError(f"holds neither {METADATA} nor a file {' or '.join(STORAGES)}")
    storage, counts = STORAGES[files[0].suffix], Counter()
    for file in files:
        counts.update(_mcap_counts(file) if storage == "mcap" else _sqlite_counts(file))
    topics = [
        {
            "topic_metadata": {"name": name, "type": kind, "serialization_format": "cdr", "offered_qos_profiles": ""},
            "message_count": count,
        }
        for (name, kind), count in counts.items()
    ]
    return {
        "storage_identifier": storage,
        "relative_file_paths": [file.name for file in files],
        "duration": {"nanoseconds": 0},
        "starting_time": {"nanoseconds_since_epoch": 0},
        "message_count": sum(counts.values()),
        "topics_with_message_count": topics,
        "compression_format": "",
        "compression_mode": "",
    }


def _mcap_counts(path: Path) -> Counter:
    """Return how many messages there are of each (topic, type)."""
    file = MCAPFile(path)
    file.open()
    try:
        if not file.channels:
            file.meta_scan()
        names = {one.id: (one.topic, one.schema) for one in file.channels.values()}
        counts = Counter(dict.fromkeys(names.values(), 0))
        for chunk in file.chunks:
            counts.update({names[number]: count for number, count in chunk.channel_count.items()})
        if not file.chunks:
            wanted = [Connection(0, topic, kind, "", "", 0, None, None) for topic, kind in counts]
            counts.update((one.topic, one.msgtype) for one, _, _ in file.messages_scan(wanted))
        return counts
    finally:
        file.close()


def _sqlite_counts(path: Path) -> Counter:
    query = "SELECT name, type, (SELECT COUNT(*) FROM messages WHERE topic_id = topics.id) FROM topics ORDER BY id"
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?immutable=1", uri=True)) as database:
        return Counter({(name, kind): count for name, kind, count in database.execute(query)})
