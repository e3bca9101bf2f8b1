"""Finds switch commands in a stream of bytes, as the head does; the emulator needs it."""

from typing import List

from imagenex_852_driver.protocol.command import HEADER, LENGTH, SwitchCommand
from imagenex_852_driver.protocol.errors import FrameError


class CommandReader:
    """Incremental reader of switch commands; `rejected` counts commands that began but turned out to be invalid."""

    def __init__(self) -> None:
        self.rejected = 0
        self._buffer = bytearray()

    def feed(self, data: bytes) -> List[SwitchCommand]:
        """Take the next bytes of the stream, return the commands they complete; never raises."""
        self._buffer += data
        commands = []
        while self._find_header() and len(self._buffer) >= LENGTH:
            try:
                commands.append(SwitchCommand.decode(bytes(self._buffer[:LENGTH])))
                del self._buffer[:LENGTH]
            except FrameError:
                self.rejected += 1
                del self._buffer[:1]
        return commands

    def _find_header(self) -> bool:
        start = self._buffer.find(HEADER)
        if start < 0:
            del self._buffer[: -1 if self._buffer.endswith(HEADER[:1]) else None]
            return False
        del self._buffer[:start]
        return True
