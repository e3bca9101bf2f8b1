"""The connection to one autopilot: finds it, keeps its time, sends positions, hands on what it measures."""

import socket
import threading
import time
from dataclasses import replace
from typing import Any, Callable, Optional, Tuple, Union

from autopilot_link.messages import Firmware, Reader, Writer, firmware_of, is_of_autopilot
from autopilot_link.parameters import AutopilotLinkParameters
from autopilot_link.protocol import AutopilotClock, StatedPose
from node_support.errors import RefusedInput
from node_support.health import Health
from sonar_driver.port import READ_TIMEOUT, PortUnavailableError, datagram_address, open_port, port_losses

LINK_LOST = 3.0  # s without a message of the autopilot, whose HEARTBEAT comes each second
_QUESTION_PERIOD = 1.0  # s between questions of TIMESYNC
_REOPEN_AFTER = 1.0  # s
_LONGEST_DATAGRAM = 65535  # bytes
_IN, _OUT = "udpin:", "udpout:"
_LOSSES = (OSError, PortUnavailableError)


class Datagrams:
    """A UDP socket on which the autopilot finds us (udpin), or we it (udpout)."""

    def __init__(self, name: str) -> None:
        """Raises PortRefusedError for a name that is none, PortUnavailableError where it cannot be opened."""
        listens = name.startswith(_IN)
        rest = name[len(_IN if listens else _OUT) :]
        # Port 0 takes any that is free.
        address = (rest[:-2], 0) if listens and rest.endswith(":0") else datagram_address(f"udp://{rest}")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(READ_TIMEOUT)
        self._destination = None if listens else address
        try:
            if listens:
                self._socket.bind(address)
        except OSError as error:
            self._socket.close()
            raise PortUnavailableError(f"{name} cannot be opened: {error.strerror or error}") from error
        self.name = name if not listens else f"{_IN}{address[0]}:{self._socket.getsockname()[1]}"

    def read(self) -> Tuple[bytes, Any]:
        """Return a datagram and its sender; empty after the timeout."""
        try:
            return self._socket.recvfrom(_LONGEST_DATAGRAM)
        except (socket.timeout, ConnectionRefusedError):
            return b"", None

    def write(self, data: bytes, receiver: Any) -> None:
        """Send a datagram to the sender of an earlier one; without one to the address of the connection's name."""
        destination = receiver or self._destination
        if destination is not None:
            self._socket.sendto(data, destination)

    def close(self) -> None:
        self._socket.close()


class Line:
    """A serial line, or one of pyserial's URLs."""

    def __init__(self, name: str, baud_rate: int) -> None:
        """Raises PortError."""
        self.name = name
        self._port = open_port(name, baud_rate)

    def read(self) -> Tuple[bytes, Any]:
        """Return what came, at most after the timeout; a line has one sender."""
        with port_losses(self.name):
            return self._port.read(max(self._port.in_waiting, 1)), None

    def write(self, data: bytes, receiver: Any) -> None:
        with port_losses(self.name):
            self._port.write(data)

    def close(self) -> None:
        self._port.close()


class AutopilotLink:
    """Talks to one autopilot until it is closed, over a connection that may come and go.

    The one clock on the link is the autopilot's: positions are stamped by it, and its own questions of TIMESYNC are
    answered by it, so that an autopilot that converts stamps (PX4) leaves ours as they are.
    """

    def __init__(
        self, parameters: AutopilotLinkParameters, health: Health, clock: Callable[[], int],
        on_message: Callable[[Any, Optional[int]], None],
    ) -> None:  # fmt: skip
        """clock: returns our time, ns. on_message: takes a message of the autopilot, and its clock's lead, ns.

        Raises PortRefusedError where only the user can help; a connection that may come back is waited for.
        """
        self._parameters, self._health, self._clock, self._on_message = parameters, health, clock, on_message
        self._lock = threading.Lock()
        self._reader, self._writer, self._time = Reader(), Writer(), AutopilotClock()
        self._system, self._address = parameters.system, None
        self._firmware: Optional[Firmware] = None
        self._heard = float("-inf")
        self._asked = float("-inf")
        self._closing = threading.Event()
        self._connection = self._try_to_open()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()

    @property
    def name(self) -> str:
        """The connection as it is open now, with the port that was taken; empty where it is not."""
        return "" if self._connection is None else self._connection.name

    def obstacle(self) -> str:
        """Return why no position can be sent now; empty when one can."""
        if self._connection is None:
            return f"{self._parameters.connection} is not open"
        if self._firmware is None:
            return f"no autopilot is heard on {self.name}"
        silence = time.monotonic() - self._heard
        if silence > LINK_LOST:
            return f"nothing of the autopilot, system {self._system}, for {silence:.0f} s"
        return "" if self._time.offset_ns is not None else "the autopilot does not answer TIMESYNC"

    def send(self, pose: StatedPose) -> None:
        """Send a position that has a stamp of our clock; raises RefusedInput where there is an obstacle."""
        obstacle = self.obstacle()
        if obstacle:
            raise RefusedInput("positions not sent", obstacle)
        stamped = replace(pose, stamp_ns=pose.stamp_ns + self._time.offset_ns)
        with self._lock:
            self._write(self._writer.pose(self._system, self._firmware, self._parameters.message, stamped))

    def _run(self) -> None:
        while not self._closing.is_set():
            if self._connection is None:
                self._connection = self._try_to_open()
                if self._connection is None:
                    self._closing.wait(_REOPEN_AFTER)
                continue
            try:
                self._ask()
                data, sender = self._connection.read()
                for message in self._reader.messages(data, sender) if data else ():
                    self._take(message, sender)
            except _LOSSES as error:
                self._lose(error)
        if self._connection is not None:
            self._connection.close()

    def _try_to_open(self) -> Union[Datagrams, Line, None]:
        name = self._parameters.connection
        try:
            return Datagrams(name) if name.startswith((_IN, _OUT)) else Line(name, self._parameters.baud_rate)
        except PortUnavailableError as error:
            self._health.problem("attempts to open the connection", str(error))
            return None

    def _lose(self, error: Exception) -> None:
        self._health.problem("connections lost", f"{self.name}: {error}; it is opened again")
        with self._lock:
            self._connection.close()
            self._connection = None

    def _write(self, data: bytes) -> None:
        if self._connection is not None:
            try:
                self._connection.write(data, self._address)
            except _LOSSES as error:
                self._health.problem("messages lost", f"{self.name}: {error}")

    def _ask(self) -> None:
        """Ask for the autopilot's time once a second; on udpout this is also how it learns of us."""
        if time.monotonic() - self._asked < _QUESTION_PERIOD:
            return
        self._asked = time.monotonic()
        now = self._clock()
        self._time.request(now)
        with self._lock:
            self._write(self._writer.time_sync(self._system or 1, 0, now))

    def _take(self, message: Any, sender: Any) -> None:
        firmware = firmware_of(message)
        if firmware is not None:
            self._meet(message.get_srcSystem(), firmware)
        if not self._system or not is_of_autopilot(message, self._system):
            return
        self._health.count("messages in")
        if time.monotonic() - self._heard > LINK_LOST:
            # It may have started anew meanwhile.
            self._time = AutopilotClock()
        self._heard, self._address = time.monotonic(), sender
        try:
            if message.get_type() == "TIMESYNC":
                self._take_time(message)
            else:
                self._on_message(message, self._time.offset_ns)
        except RefusedInput as refused:
            self._health.problem(refused.kind, str(refused))

    def _meet(self, system: int, firmware: Firmware) -> None:
        if not self._system:
            self._system = system
        if system == self._system:
            self._firmware = firmware
            self._health.show("autopilot", f"system {system}, {firmware.name}")
        elif not self._parameters.system:
            detail = f"system {system} besides {self._system}, which was heard first; set system"
            self._health.problem("heartbeats of other autopilots", detail)

    def _take_time(self, message: Any) -> None:
        now, jumps = self._clock(), self._time.jumps
        if message.tc1:
            self._time.take_answer(message.ts1, message.tc1, now)
        elif self._time.offset_ns is not None:
            with self._lock:
                self._write(self._writer.time_sync(self._system, now + self._time.offset_ns, message.ts1))
        if self._time.jumps > jumps:
            self._health.problem("jumps of the autopilot's clock", "it was set, or the autopilot started anew")
        if self._time.offset_ns is not None:
            self._health.show("time offset [s]", f"{self._time.offset_ns * 1e-9:.3f}")
            self._health.show("round trip [ms]", f"{self._time.trip_ns * 1e-6:.1f}")
