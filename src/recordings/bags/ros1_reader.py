"""Reads bags of ROS 1 as rosbags does, but unpacks each chunk once, and reads one header per topic only."""

import struct
from collections import OrderedDict
from heapq import merge
from io import BytesIO
from pathlib import Path
from typing import Dict, Iterable, Iterator, List, NamedTuple, Tuple

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader
from rosbags.rosbag1.reader import Header, IndexData, ReaderError, RecordType

_KEPT_BYTES = 64 * 2**20  # all of a recording of an hour, and little beside a map
_LENGTH = struct.Struct("<I")
_TIME = struct.Struct("<II")
_ENTRY = struct.Struct("<III")
_INDEX_FIELDS = 55
"""Bytes of the header and the length of an index record, which always has the same fields."""


class _Head(NamedTuple):
    """The header of a connection's messages: what stands before and after the time."""

    before: bytes
    after: bytes


class Ros1Reader(Reader):
    """A Reader whose `messages` yields the same. kept_bytes: of unpacked chunks that it keeps for another topic."""

    def __init__(self, path: Path, kept_bytes: int = _KEPT_BYTES) -> None:
        super().__init__(path)
        self._kept_bytes = kept_bytes
        self._unpacked: OrderedDict[int, bytes] = OrderedDict()
        self._heads: Dict[int, _Head] = {}

    def read_index_data(self, pos: int, indexes: Dict[int, List[IndexData]]) -> None:
        """Read one index record of the chunk at `pos`; see Reader."""
        start = self.bio.tell()
        header = Header.read(self.bio, RecordType.IDXDATA)
        count, size = header.get_uint32("count"), _LENGTH.unpack(self.bio.read(_LENGTH.size))[0]
        if header.get_uint32("ver") != 1 or self.bio.tell() - start != _INDEX_FIELDS or size != count * _ENTRY.size:
            raise ReaderError("Index record could not be read.")
        entries = _ENTRY.iter_unpack(self.bio.read(size))
        indexes[header.get_uint32("conn")].extend([IndexData(s * 10**9 + ns, pos, offset) for s, ns, offset in entries])

    def messages(
        self, connections: Iterable[Connection] = (), start: object = None, stop: object = None
    ) -> Iterator[Tuple[Connection, int, bytes]]:
        """Yield connection, time of recording [ns] and bytes of the messages of `connections` in the order of time.

        `start` and `stop` are not supported.
        """
        wanted = list(connections or self.connections)
        if len(wanted) > 1:
            yield from merge(*(self.messages([one]) for one in wanted), key=_recorded)
            return
        for time, place, offset in self.indexes[wanted[0].id]:
            yield wanted[0], time, self._message(wanted[0], self._chunk(place), offset, time)

    def _chunk(self, place: int) -> bytes:
        """Return the unpacked chunk at a place in the file."""
        found = self._unpacked.get(place)
        if found is None:
            chunk = self.chunks[place]
            self.bio.seek(chunk.datapos)
            found = self._unpacked[place] = chunk.decompressor(self.bio.read(chunk.datasize))
            while len(self._unpacked) > 1 and sum(map(len, self._unpacked.values())) > self._kept_bytes:
                self._unpacked.popitem(last=False)
        return found

    def _message(self, connection: Connection, chunk: bytes, offset: int, time: int) -> bytes:
        """Return the bytes of the message whose record begins at an offset in a chunk. Raises ReaderError."""
        start = offset + _LENGTH.size
        end = start + _LENGTH.unpack_from(chunk, offset)[0]
        head = self._heads.get(connection.id)
        if head is None or chunk[start:end] != head.before + _TIME.pack(*divmod(time, 10**9)) + head.after:
            head = self._heads[connection.id] = _head(connection, chunk[offset:end], time)
        first = end + _LENGTH.size
        data = chunk[first : first + _LENGTH.unpack_from(chunk, end)[0]]
        if len(data) != _LENGTH.unpack_from(chunk, end)[0]:
            raise ReaderError("Message ends after its chunk.")
        return data


def _head(connection: Connection, record: bytes, time: int) -> _Head:
    """Return what is the same in the headers of a connection's messages. Raises ReaderError where `record` is none."""
    header = Header.read(BytesIO(record), RecordType.MSGDATA)
    if (header.get_uint32("conn"), header.get_time("time")) != (connection.id, time):
        raise ReaderError("Message is not where the index says.")
    stamp = b"time=" + _TIME.pack(*divmod(time, 10**9))
    before, _, after = record[_LENGTH.size :].partition(stamp)
    return _Head(before + b"time=", after)


def _recorded(message: Tuple[Connection, int, bytes]) -> int:
    return message[1]
