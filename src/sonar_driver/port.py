"""Opens a serial port or a UDP connection, and says in one line why it cannot be opened; parameters of every line."""

import errno
import grp
import os
import socket
import termios
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Iterator, Tuple, Union

import serial

from node_support.parameters import ParameterError, ParameterSet, parameter


@dataclass(frozen=True)
class LineParameters(ParameterSet):
    """Where the head is connected, how long the driver waits for it, and how it reconnects."""

    port: str = parameter("/dev/ttyUSB0", "device or pyserial URL (socket://, rfc2217://, loop://)", tunable=False)
    baud_rate: int = parameter(115200, "speed of the line, 8N1", unit="bit/s", low=1200, tunable=False)
    back_off_first: float = parameter(
        0.1, "wait before the first attempt to reopen the port", unit="s", low=0.01, high=1.0, tunable=False
    )
    back_off_longest: float = parameter(
        1.0, "longest wait between attempts; each wait is twice the previous one",
        unit="s", low=0.01, high=1.5, tunable=False,
    )  # fmt: skip
    reopen_after: float = parameter(
        5.0, "reopen the port after so long without a reply", unit="s", low=0.1, tunable=False
    )
    reply_margin: float = parameter(
        0.25, "how long to wait for a reply beyond the time that head, sound and line need",
        unit="s", low=0.01, high=4.0, tunable=False,
    )  # fmt: skip
    late_window: float = parameter(
        0.25, "how long to wait after a timeout for a late reply, so that the next ping does not get it",
        unit="s", low=0.0, high=4.0, tunable=False,
    )  # fmt: skip
    byte_gap: float = parameter(0.1, "silence that ends part of a reply", unit="s", low=0.01, high=1.0, tunable=False)

    def check(self) -> None:
        super().check()
        if self.back_off_first > self.back_off_longest:
            raise ParameterError(
                f"back_off_first = {self.back_off_first}: longer than back_off_longest = {self.back_off_longest}"
            )


@dataclass(frozen=True)
class MountingParameters(ParameterSet):
    """How the head is mounted."""

    frame_id: str = parameter("sonar", "frame of the head, in which it tilts but does not turn", tunable=False)
    inverted: bool = parameter(False, "the head is mounted upside down")
    sensor_joint: str = parameter(
        "", "joint of /joint_states that tilts the head, for sensorAngle; empty: none",
        tunable=False, may_be_empty=True,
    )  # fmt: skip


_BITS_PER_BYTE = 10  # 8N1: one start bit, eight data bits, one stop bit
LONGEST_DATAGRAM = 65535  # Bytes
READ_TIMEOUT = 0.05  # s: a read returns after this time at the latest, so that a request to stop is noticed
_WRITE_TIMEOUT = 0.5  # s: a command takes 3 ms; a port that blocks for longer is lost
_REMOTE = ("socket://", "rfc2217://", "loop://")
_USUAL_GROUP = "dialout"
_DATAGRAMS = "udp://"
_PORT_NUMBERS = 1 << 16


def transmission_time(byte_count: int, baud_rate: float) -> float:
    """Return how long `byte_count` bytes take at `baud_rate` bit/s, in seconds; no time at an infinite rate."""
    return byte_count * _BITS_PER_BYTE / baud_rate


class UdpPort:
    """A port on which each message is a datagram; what arrives is a stream of bytes to the reader."""

    def __init__(self, host: str, number: int) -> None:
        """Raises OSError. Nobody notices whether somebody listens there before something is sent."""
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
        deadline = time.monotonic() + READ_TIMEOUT
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
        self._socket.close()

    def _receive(self, timeout: float) -> bool:
        self._socket.settimeout(max(timeout, 0.0))
        try:
            self._buffer += self._socket.recv(LONGEST_DATAGRAM)
        except (socket.timeout, BlockingIOError):
            return False
        return True


Port = Union[serial.SerialBase, UdpPort]
"""What a driver reads and writes; a read returns after READ_TIMEOUT at the latest."""


class PortError(Exception):
    """The port cannot be used; the text is one line for the user."""


class PortUnavailableError(PortError):
    """The port does not exist or was lost; it may come back."""


class PortRefusedError(PortError):
    """The user has to correct something first: the name, a permission, or a program that holds the port."""


def open_port(name: str, baud_rate: int) -> Port:
    """Open a device or pyserial URL with 8N1, or udp://HOST:PORT; a local device is opened exclusively.

    Raises PortUnavailableError or PortRefusedError.
    """
    if is_datagram_port(name):
        try:
            return UdpPort(*datagram_address(name))
        except OSError as error:
            raise PortUnavailableError(f"port {name} cannot be opened: {error.strerror or error}") from error
    local = not name.startswith(_REMOTE)
    # pyserial's remote ports refuse a write timeout.
    options = {"exclusive": True, "write_timeout": _WRITE_TIMEOUT} if local else {}
    try:
        return serial.serial_for_url(name, baudrate=baud_rate, timeout=READ_TIMEOUT, **options)
    except (OSError, termios.error) as error:
        raise _explained(name, error) from error
    except ValueError as error:
        raise PortRefusedError(f"port {name}: {error}") from error


def is_datagram_port(name: str) -> bool:
    """Return whether a port has no line: no speed, and nothing to break."""
    return name.startswith(_DATAGRAMS)


def datagram_address(name: str) -> Tuple[str, int]:
    """Return host and number of udp://HOST:PORT; raises PortRefusedError."""
    host, _, number = name[len(_DATAGRAMS) :].rpartition(":")
    if not host or not number.isdecimal() or not 0 < int(number) < _PORT_NUMBERS:
        raise PortRefusedError(f"port {name}: must be udp://HOST:PORT with a PORT from 1 to {_PORT_NUMBERS - 1}")
    return host, int(number)


@contextmanager
def port_losses(name: str) -> Iterator[None]:
    """Turn every way in which pyserial reports a lost port into PortUnavailableError."""
    try:
        yield
    except (OSError, termios.error) as error:
        raise PortUnavailableError(f"port {name} is lost: {error}") from error


def _explained(name: str, error: Exception) -> PortError:
    number = getattr(error, "errno", None)
    if number in (errno.EWOULDBLOCK, errno.EBUSY):
        return PortRefusedError(f"port {name} is in use by another program: is a second driver running?")
    if number in (errno.EACCES, errno.EPERM):
        group = _group_of(name)
        return PortRefusedError(
            f"no permission to open port {name}: join the group {group} (sudo adduser $USER {group}) and log in again"
        )
    # pyserial's own text names the port and the reason twice.
    return PortUnavailableError(f"port {name} cannot be opened: {os.strerror(number) if number else error}")


def _group_of(name: str) -> str:
    try:
        group = grp.getgrgid(os.stat(name).st_gid).gr_name
    except (OSError, KeyError):
        return _USUAL_GROUP
    return group if group != "root" else _USUAL_GROUP
