"""Reads bags of ROS 1, also those without an index, whose recording was cut off."""

import struct
from collections import defaultdict
from io import BytesIO
from typing import Dict, List, Optional

from rosbags.interfaces import Connection
from rosbags.rosbag1.reader import Header, IndexData, Reader, ReaderError, RecordType, read_uint32

_NO_INDEX = ("not indexed", "index looks damaged")
_NOT_WHOLE = (ReaderError, AssertionError, struct.error, ValueError)  # raised by a record that was cut off


class Ros1Reader(Reader):
    """Reads a bag by its index, or, where that is missing, chunk by chunk; a last chunk that is not whole is left out.

    is_cut: whether the index is missing.
    """

    is_cut = False

    def open(self) -> None:
        """Open the bag. Raises ReaderError where it holds no whole chunk."""
        try:
            super().open()
        except ReaderError as error:
            if not any(sign in str(error) for sign in _NO_INDEX):
                raise
            self.is_cut, self.connections = True, []
            self._open_without_index()

    def _open_without_index(self) -> None:
        self.bio = self.path.open("rb")
        self.bio.readline()
        Header.read(self.bio, RecordType.BAGHEADER)
        self.bio.seek(read_uint32(self.bio), 1)
        found: Dict[int, List[IndexData]] = defaultdict(list)
        try:
            while True:
                self._take_chunk(found)
        except _NOT_WHOLE:
            pass
        self.indexes = {number: sorted(entries) for number, entries in found.items()}
        unknown = set(self.indexes)
        for position in self.chunks:
            if any(entry.chunk_pos == position for number in unknown for entry in self.indexes[number]):
                self._learn_connections(position)
                unknown -= {one.id for one in self.connections}
        if not self.connections:
            self.close()
            raise ReaderError("the recording was cut off before its first chunk ended")

    def _take_chunk(self, found: Dict[int, List[IndexData]]) -> None:
        """Learn the chunk that comes next, and add where its messages lie to `found`."""
        position = self.bio.tell()
        chunk = self.read_chunk()
        if not chunk.datasize:
            raise ReaderError("this chunk was not finished")
        while self._next_type() is RecordType.IDXDATA:
            self.read_index_data(position, found)
            self.chunks[position] = chunk

    def _next_type(self) -> Optional[RecordType]:
        """Return of what type the next record is, and stay before it; None at the end."""
        position = self.bio.tell()
        try:
            return RecordType(Header.read(self.bio).get_uint8("op"))
        except _NOT_WHOLE:
            return None
        finally:
            self.bio.seek(position)

    def _learn_connections(self, position: int) -> None:
        """Add the connections that the chunk at `position` declares to those known."""
        chunk = self.chunks[position]
        self.bio.seek(chunk.datapos)
        # The library reads records of whatever `bio` is.
        file, self.bio = self.bio, BytesIO(chunk.decompressor(self.bio.read(chunk.datasize)))
        try:
            while True:
                kind = self._next_type()
                if kind is None:
                    return
                if kind is RecordType.CONNECTION:
                    one = self.read_connection()
                    self.connections.append(Connection(*one[:5], len(self.indexes.get(one.id, ())), *one[6:]))
                else:
                    Header.read(self.bio)
                    self.bio.seek(read_uint32(self.bio), 1)
        finally:
            self.bio = file
