"""Serves an emulated head on a line, a pseudo-terminal or a UDP port, which it can take away and bring back."""

import contextlib
import os
import select
import socket
import threading
import time
import tty
from collections import deque
from typing import Deque, Optional, Tuple, Union

from sonar_driver.emulated_head import EmulatedHead, Transmission
from sonar_driver.port import LONGEST_DATAGRAM

_READ_SIZE = 4096  # Bytes: more than commands, or what wakes the server, ever take; a read takes what is there


class PtyLine:
    """The head's end of a pseudo-terminal; `link` is a symbolic link to the end that the driver opens."""

    def __init__(self, link: str) -> None:
        self._link = link
        self._master: Optional[int] = None
        self._slave: Optional[int] = None

    def open(self) -> None:
        """Make the terminal and the link to it; raises OSError."""
        if os.path.exists(self._link) and not os.path.islink(self._link):
            raise FileExistsError(f"{self._link} exists and is not a symbolic link")
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        temporary = f"{self._link}.{os.getpid()}"
        with contextlib.suppress(FileNotFoundError):
            os.unlink(temporary)
        os.symlink(os.ttyname(self._slave), temporary)
        os.replace(temporary, self._link)

    def close(self) -> None:
        """Remove the link, unless somebody else has put theirs there, and hang up."""
        if self._master is None:
            return
        with contextlib.suppress(FileNotFoundError):
            if os.readlink(self._link) == os.ttyname(self._slave):
                os.unlink(self._link)
        os.close(self._slave)
        os.close(self._master)
        self._master = self._slave = None

    def fileno(self) -> int:
        return self._master

    def read(self) -> bytes:
        with contextlib.suppress(BlockingIOError):
            return os.read(self._master, _READ_SIZE)
        return b""

    def write(self, data: bytes) -> None:
        """Send bytes; a full terminal loses them."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._master, data)


class UdpLine:
    """The head's end of a UDP connection."""

    def __init__(self, host: str, number: int) -> None:
        self._address = (host, number)
        self._socket: Optional[socket.socket] = None
        self._peer: Optional[Tuple[str, int]] = None

    def open(self) -> None:
        """Listen at the address; raises OSError."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(self._address)
        self._socket.setblocking(False)
        self._peer = None

    def close(self) -> None:
        """Stop listening: who sends something then is told that nobody is there."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def fileno(self) -> int:
        return self._socket.fileno()

    def read(self) -> bytes:
        with contextlib.suppress(BlockingIOError, ConnectionError):
            data, self._peer = self._socket.recvfrom(LONGEST_DATAGRAM)
            return data
        return b""

    def write(self, data: bytes) -> None:
        """Send a datagram to whoever spoke last; it is lost where nobody has."""
        if self._peer is not None:
            with contextlib.suppress(BlockingIOError, ConnectionError):
                self._socket.sendto(data, self._peer)


ServedLine = Union[PtyLine, UdpLine]
"""The head's end of a line. It is used from one thread at a time, and never waits."""


class HeadServer:
    """Makes a head answer on a line: a context manager, which serves from a thread of its own.

    While the line has disappeared, whoever has it open sees it hang up.
    """

    def __init__(self, head: EmulatedHead, line: ServedLine) -> None:
        self.head = head
        self._line = line
        self._present = False
        self._outgoing: Deque[Transmission] = deque()
        self._stop = threading.Event()
        self._wake_reader, self._wake_writer = os.pipe()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> "HeadServer":
        """Raises OSError when the line cannot be made."""
        self._appear()
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stop.set()
        self._wake()
        self._thread.join()
        os.close(self._wake_reader)
        os.close(self._wake_writer)

    def _serve(self) -> None:
        try:
            while not self._stop.is_set():
                self._turn()
        finally:
            self._vanish()

    def _turn(self) -> None:
        now = time.monotonic()
        hidden = self.head.absent_from <= now < self.head.absent_until
        if hidden and self._present:
            self._vanish()
        elif not hidden and not self._present:
            self._appear()
        if self._present:
            if now >= self.head.next_event:
                self._outgoing.extend(self.head.advance(now))
            while self._outgoing and self._outgoing[0].time <= now:
                self._line.write(self._outgoing.popleft().data)
        sources = [self._wake_reader, self._line.fileno()] if self._present else [self._wake_reader]
        readable = select.select(sources, [], [], self._until_next_event(now))[0]
        if self._wake_reader in readable:
            os.read(self._wake_reader, _READ_SIZE)
        if len(readable) > int(self._wake_reader in readable):
            self._outgoing.extend(self.head.receive(self._line.read(), time.monotonic()))

    def _until_next_event(self, now: float) -> Optional[float]:
        if not self._present:
            moment = self.head.absent_until
        else:
            gone_at = self.head.absent_from if now < self.head.absent_until else float("inf")
            moment = min(gone_at, self.head.next_event, self._outgoing[0].time if self._outgoing else float("inf"))
        return max(0.0, moment - now) if moment < float("inf") else None

    def _appear(self) -> None:
        self._line.open()
        self._present = True

    def _vanish(self) -> None:
        self._line.close()
        self._present = False
        self._outgoing.clear()

    def _wake(self) -> None:
        os.write(self._wake_writer, b"w")
