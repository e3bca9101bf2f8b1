"""A head on its line: opens and closes the port, and turns every way of losing it into one exception."""

import threading
import time
from abc import ABC, abstractmethod
from typing import Callable, Generic, Optional, TypeVar

from sonar_driver.line.parameters import LineParameters
from sonar_driver.line.port import Port, PortError, PortUnavailableError, open_port, port_losses
from sonar_driver.line.stats import LineStats, StatsRecorder

Command = TypeVar("Command")
Ping = TypeVar("Ping")


class LineDevice(ABC, Generic[Command, Ping]):
    """Gets one ping after the other from a head; `stop` interrupts every wait within a twentieth of a second.

    One thread uses it; `stats` may be read from any.
    """

    def __init__(
        self,
        connection: LineParameters,
        zero: LineStats,
        stop: Optional[threading.Event] = None,
        clock: Callable[[], float] = time.time,
        elapsed: Callable[[], float] = time.monotonic,
        opener: Callable[[str, int], Port] = open_port,
    ) -> None:
        """`zero` is what the counts start from.

        `clock` gives the stamps of the pings, `elapsed` the time for the deadlines, both in seconds. `opener` opens a
        port, as `open_port` does.
        """
        self.connection = connection
        self.stop = stop or threading.Event()
        self.elapsed = elapsed
        self._clock = clock
        self._opener = opener
        self._recorder = StatsRecorder(zero)
        self._port: Optional[Port] = None

    @property
    def stats(self) -> LineStats:
        """The counts up to the last ping."""
        return self._recorder.current

    def open(self) -> None:
        """Open the port and greet the head; raises a PortError and remembers its text."""
        self.close()
        try:
            self._port = self._opener(self.connection.port, self.connection.baud_rate)
            with port_losses(self.connection.port):
                self._greet()
        except PortError as error:
            self._recorder.note(last_error=str(error))
            self.close()
            raise
        self._recorder.count("connections")
        self._recorder.note(connected=True)

    def close(self) -> None:
        """Take leave of the head and close the port, if it is open."""
        port, self._port = self._port, None
        self._recorder.note(connected=False)
        if port is not None:
            for farewell in (self._take_leave, _close):
                try:
                    with port_losses(self.connection.port):
                        farewell(port)
                except PortUnavailableError as error:
                    self._recorder.note(last_error=str(error))

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
            self._recorder.note(last_error=str(error))
            self.close()
            raise

    @abstractmethod
    def _ping(self, command: Command) -> Optional[Ping]:
        """Do what `ping` does, on a port that is open."""

    def _greet(self) -> None:
        """Find out who is at the other end of the open port; raise a PortError if nobody is."""

    def _take_leave(self, port: Port) -> None:
        """Leave the head in a state of rest."""


def _close(port: Port) -> None:
    port.close()
