"""The driver's loop: sends pings until it is stopped, and reconnects whenever the port is lost."""

import contextlib
from typing import Callable, Generic

from sonar_driver.line.device import Command, LineDevice, Ping
from sonar_driver.line.port import PortError, PortUnavailableError


class Scanner(Generic[Command, Ping]):
    """Pings with the current command. `command` may be assigned from any thread and applies to the next ping.

    Every command carries all settings, so the scan continues as configured after a reconnection or a reboot of
    the head.
    """

    def __init__(self, device: LineDevice[Command, Ping], command: Command, on_ping: Callable[[Ping], None]) -> None:
        """`on_ping` is called in the thread of `run`, once per valid reply, in order; it must not raise."""
        self.command = command
        self._device = device
        self._on_ping = on_ping
        self._back_off = device.connection.back_off_first
        self._last_reply = self._device.elapsed()

    def connect(self) -> None:
        """Open the port for the first time; `run` waits for a port that does not exist yet.

        Raises PortBusyError, PortPermissionError or PortNameError, which the user must correct.
        """
        with contextlib.suppress(PortUnavailableError):
            self._device.open()

    def run(self) -> None:
        """Ping until the device's stop event is set, then close the port."""
        try:
            while not self._device.stop.is_set():
                if self._device.stats.connected or self._reconnected():
                    self._ping()
        finally:
            self._device.close()

    def _ping(self) -> None:
        try:
            ping = self._device.ping(self.command)
        except PortUnavailableError:
            return
        now = self._device.elapsed()
        if ping is not None:
            self._last_reply = now
            self._back_off = self._device.connection.back_off_first
            self._on_ping(ping)
        elif now - self._last_reply > self._device.connection.reopen_after:
            # An adapter can hang, or a network connection die, without the port ever reporting it.
            self._last_reply = now
            self._device.close()

    def _reconnected(self) -> bool:
        if self._device.stop.wait(self._back_off):
            return False
        self._back_off = min(2 * self._back_off, self._device.connection.back_off_longest)
        try:
            self._device.open()
        except PortError:
            return False
        self._last_reply = self._device.elapsed()
        return True
