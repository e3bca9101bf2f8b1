"""A head on its line, pinged in a loop that reconnects when the port is lost, and the counts for /diagnostics."""

import contextlib
import threading
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from operator import methodcaller
from typing import Callable, ClassVar, Dict, Generic, Mapping, Optional, TypeVar

from node_support.health import Health, HealthReport, Level
from sonar_driver.port import LineParameters, Port, PortError, PortUnavailableError, open_port, port_losses


@dataclass(frozen=True)
class LineStats:
    """Counts since the start; every ping is counted in exactly one of the four fields after `pings`.

    `timeouts`: nothing was received. `bad_frames`: something was received, but no valid answer. `interrupted`: the
    port was lost or the driver stopped before the answer. `unexpected_replies`: whole replies that answered no
    outstanding command, late or sent twice; they are dropped.
    """

    connected: bool = False
    pings: int = 0
    replies: int = 0
    timeouts: int = 0
    bad_frames: int = 0
    interrupted: int = 0
    unexpected_replies: int = 0
    connections: int = 0
    last_error: str = ""

    problems: ClassVar[Mapping[str, str]] = {}
    """What to check when a count that should stay zero does not, by the name of its field with spaces."""

    def details(self) -> Dict[str, str]:
        """Return what else /diagnostics shows of this sonar."""
        return {}


class DriverHealth(Health):
    """Reports the device's counts; ERROR while it is not connected."""

    def __init__(
        self,
        name: str,
        warn: Callable[[str], None],
        read_stats: Callable[[], LineStats],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(name, warn, clock)
        self._read_stats = read_stats
        self._seen: Dict[str, int] = {}

    def report(self) -> HealthReport:
        stats = self._read_stats()
        self.show("connected", str(stats.connected).lower())
        self.show("last error", stats.last_error)
        self.show("connections", str(stats.connections))
        self.total("pings", stats.pings)
        self.total("replies", stats.replies)
        for name, value in stats.details().items():
            self.show(name, value)
        for kind, hint in stats.problems.items():
            self._note_problem(kind, hint, getattr(stats, kind.replace(" ", "_")))
        losses = max(0, stats.connections - int(stats.connected))
        self._note_problem("losses of the port", stats.last_error, losses)
        report = super().report()
        if stats.connected:
            return report
        return replace(report, level=Level.ERROR, text=f"not connected: {stats.last_error or 'not opened yet'}")

    def _note_problem(self, kind: str, detail: str, total: int) -> None:
        seen = self._seen.get(kind, 0)
        if total > seen:
            self.problem(kind, detail, total - seen)
        self._seen[kind] = total
        self.show(kind, str(total))


Command = TypeVar("Command")
Ping = TypeVar("Ping")


class LineDevice(ABC, Generic[Command, Ping]):
    """Gets one ping after the other from a head; `stop` interrupts every wait within a twentieth of a second.

    One thread uses it; `stats`, the counts up to the last ping, may be read from any. `command`, what `run` pings with,
    may be assigned from any and applies to the next ping. Every command carries all settings, so the scan continues as
    configured after a reconnection or a reboot of the head.
    """

    command: Command

    zero = LineStats()
    """What the counts start from."""

    def __init__(
        self,
        connection: LineParameters,
        stop: Optional[threading.Event] = None,
        clock: Callable[[], float] = time.time,
        elapsed: Callable[[], float] = time.monotonic,
        opener: Callable[[str, int], Port] = open_port,
    ) -> None:
        """`clock` gives the stamps of the pings, `elapsed` the time for deadlines, both in s; `opener` opens a port."""
        self.connection = connection
        self.stop = stop or threading.Event()
        self.elapsed = elapsed
        self._clock = clock
        self._opener = opener
        self.stats = self.zero
        self._port: Optional[Port] = None
        self._back_off = connection.back_off_first
        self._last_reply = elapsed()

    def run(self, on_ping: Callable[[Ping], None]) -> None:
        """Ping until the stop event is set, then close the port.

        `on_ping` is called in this thread, once per valid reply, in order; it must not raise.
        """
        try:
            while not self.stop.is_set():
                if self.stats.connected or self._reconnected():
                    with contextlib.suppress(PortUnavailableError):
                        self._heard(self.ping(self.command), on_ping)
        finally:
            self.close()

    def _heard(self, ping: Optional[Ping], on_ping: Callable[[Ping], None]) -> None:
        now = self.elapsed()
        if ping is not None:
            self._last_reply = now
            self._back_off = self.connection.back_off_first
            on_ping(ping)
        elif now - self._last_reply > self.connection.reopen_after:
            # An adapter can hang, or a network connection die, without the port ever reporting it.
            self._last_reply = now
            self.close()

    def _reconnected(self) -> bool:
        if self.stop.wait(self._back_off):
            return False
        self._back_off = min(2 * self._back_off, self.connection.back_off_longest)
        try:
            self.open()
        except PortError:
            return False
        self._last_reply = self.elapsed()
        return True

    def open(self) -> None:
        """Open the port and greet the head; raises a PortError and remembers its text."""
        self.close()
        try:
            self._port = self._opener(self.connection.port, self.connection.baud_rate)
            with port_losses(self.connection.port):
                self._greet()
        except PortError as error:
            self._note(last_error=str(error))
            self.close()
            raise
        self._count("connections")
        self._note(connected=True)

    def close(self) -> None:
        """Take leave of the head and close the port, if it is open."""
        port, self._port = self._port, None
        self._note(connected=False)
        if port is not None:
            for farewell in (self._take_leave, methodcaller("close")):
                try:
                    with port_losses(self.connection.port):
                        farewell(port)
                except PortUnavailableError as error:
                    self._note(last_error=str(error))

    def ping(self, command: Command) -> Optional[Ping]:
        """Wait for the next ping of a head that does what `command` says.

        Returns None if there was no valid reply, which is counted in `stats`. Raises PortUnavailableError if the port
        is lost or not open, and closes it.
        """
        if self._port is None:
            raise PortUnavailableError(f"port {self.connection.port} is not open")
        try:
            with port_losses(self.connection.port):
                return self._ping(command)
        except PortUnavailableError as error:
            self._note(last_error=str(error))
            self.close()
            raise

    @abstractmethod
    def _ping(self, command: Command) -> Optional[Ping]:
        """Do what `ping` does, on a port that is open."""

    def _count(self, name: str, error: str = "", number: int = 1) -> None:
        """Increase a count of `stats`, and store the error if there is one."""
        changes = {"last_error": error} if error else {}
        self._note(**{name: getattr(self.stats, name) + number}, **changes)

    def _note(self, **values: object) -> None:
        self.stats = replace(self.stats, **values)

    def _greet(self) -> None:
        """Find out who is at the other end of the open port; raise a PortError if nobody is."""

    def _take_leave(self, port: Port) -> None:
        """Leave the head in a state of rest."""
