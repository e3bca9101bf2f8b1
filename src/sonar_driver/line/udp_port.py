"""A UDP connection that looks like a serial port to a driver."""

import socket
import time

_LONGEST_DATAGRAM = 65535  # Bytes


class UdpPort:
    """A port on which each message is a datagram; what arrives is a stream of bytes to the reader."""

    def __init__(self, host: str, number: int, read_timeout: float) -> None:
        """Raises OSError. Nobody notices whether somebody listens there before something is sent."""
        self._read_timeout = read_timeout
        self._buffer = bytearray()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.connect((host, number))
        except OSError:
            self._socket.close()
            raise

    @property
    def in_waiting(self) -> int:
        """Number of bytes that were received and not yet read. Raises OSError."""
        self._receive(0.0)
        return len(self._buffer)

    def read(self, size: int = 1) -> bytes:
        """Return up to `size` bytes: once there are so many, or after the timeout those that there are."""
        deadline = time.monotonic() + self._read_timeout
        while len(self._buffer) < size and self._receive(deadline - time.monotonic()):
            pass
        data = bytes(self._buffer[:size])
        del self._buffer[:size]
        return data

    def write(self, data: bytes) -> int:
        """Send a datagram. Raises OSError, also for an earlier one that nobody received."""
        return self._socket.send(data)

    def send_break(self) -> None:
        """Do nothing: there is no line to break."""

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def _receive(self, timeout: float) -> bool:
        """Wait for one datagram; return whether one came."""
        self._socket.settimeout(max(timeout, 0.0))
        try:
            self._buffer += self._socket.recv(_LONGEST_DATAGRAM)
        except (socket.timeout, BlockingIOError):
            return False
        return True
