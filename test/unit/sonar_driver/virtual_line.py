"""A serial line in time that passes only while somebody waits: an hour of it takes seconds, and always the same."""

import math
import threading
from collections import deque
from typing import Deque, Optional

from sonar_driver.emulated_head import EmulatedHead, Transmission
from sonar_driver.port import READ_TIMEOUT, PortUnavailableError, transmission_time


class VirtualTime(threading.Event):
    """Seconds `now` since the experiment began; a device's stop event, whose waits pass the time, set at `end`."""

    def __init__(self, end: float = math.inf) -> None:
        super().__init__()
        self.now = 0.0
        self._end = end

    def elapsed(self) -> float:
        """Return the time, s."""
        return self.now

    def is_set(self) -> bool:
        """Return whether the event was set, or the end has come."""
        return super().is_set() or self.now >= self._end

    def wait(self, timeout: Optional[float] = None) -> bool:
        """Let `timeout` seconds pass at once, but not beyond the end."""
        self.now += max(min(timeout or 0.0, self._end - self.now), 0.0)
        return self.is_set()


class VirtualLine:
    """The port of an emulated head, as far as the device uses a port of pyserial."""

    def __init__(self, head: EmulatedHead, baud_rate: float, time: VirtualTime) -> None:
        self._head, self._baud_rate, self._time = head, baud_rate, time
        self._outgoing: Deque[Transmission] = deque()
        self._arrived = bytearray()

    def open(self, name: str, _: int) -> "VirtualLine":
        """Return this port; raises PortUnavailableError while it has disappeared."""
        if self._is_absent():
            raise PortUnavailableError(f"port {name} cannot be opened")
        return self

    def close(self) -> None:
        """Lose what nobody has read."""
        self._arrived.clear()

    def write(self, data: bytes) -> int:
        """Hand a command to the head, which acts when its last byte has arrived."""
        self._check_present()
        self._deliver()
        arrival = self._time.now + transmission_time(len(data), self._baud_rate)
        self._outgoing.extend(self._head.receive(data, arrival))
        return len(data)

    def send_break(self) -> None:
        """Do nothing: an emulated head does not hear it."""

    @property
    def in_waiting(self) -> int:
        """Number of bytes that have arrived."""
        self._check_present()
        self._deliver()
        return len(self._arrived)

    def read(self, size: int = 1) -> bytes:
        """Return `size` bytes, or what has come until the timeout."""
        deadline = self._time.now + READ_TIMEOUT
        while self.in_waiting < size and self._next_event() <= deadline:
            self._time.now = max(self._time.now, self._next_event())
        if self.in_waiting < size:
            self._time.now = deadline
        data = bytes(self._arrived[:size])
        del self._arrived[:size]
        return data

    def _next_event(self) -> float:
        return min(self._head.next_event, self._outgoing[0].time if self._outgoing else float("inf"))

    def _deliver(self) -> None:
        while self._head.next_event <= self._time.now:
            self._outgoing.extend(self._head.advance(self._head.next_event))
        while self._outgoing and self._outgoing[0].time <= self._time.now:
            self._arrived += self._outgoing.popleft().data

    def _check_present(self) -> None:
        if self._is_absent():
            self._outgoing.clear()
            raise OSError("the port has disappeared")

    def _is_absent(self) -> bool:
        return self._head.absent_from <= self._time.now < self._head.absent_until
