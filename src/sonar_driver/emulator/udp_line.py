"""A head on a network without hardware: a UDP port that answers whoever spoke last."""

import contextlib
import socket
from typing import Optional, Tuple

_LONGEST_DATAGRAM = 65535  # Bytes


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
        """Return the descriptor that becomes readable when bytes arrive."""
        return self._socket.fileno()

    def read(self) -> bytes:
        """Return the bytes of the next datagram, possibly none."""
        with contextlib.suppress(BlockingIOError, ConnectionError):
            data, self._peer = self._socket.recvfrom(_LONGEST_DATAGRAM)
            return data
        return b""

    def write(self, data: bytes) -> None:
        """Send a datagram to whoever spoke last; it is lost where nobody has."""
        if self._peer is not None:
            with contextlib.suppress(BlockingIOError, ConnectionError):
                self._socket.sendto(data, self._peer)
