"""Messages on an open port, each with the time at which its first byte left the head."""

import math
import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import Callable, Deque, List, Optional, Tuple

from ping360_driver.messages import MessageStream, ParsedMessage, PingMessage
from ping360_driver.scan_command import TICK
from sonar_driver.port import Port, transmission_time

# After a break the head measures the speed of the line by this letter: as many ones as zeros, in turn (brping).
_SPEED_SAMPLE = b"U"
# s: a busy line counts as quiet after a pause that is longer than USB adapters make; the longest wait for that.
_QUIET = 0.02
_LONGEST_DRAIN = 0.2
_WAKING_TIME = 0.2  # s: Ping Viewer waits as long after a break


@dataclass(frozen=True)
class Arrival:
    """A message, its bytes, and when its first byte left the head, in seconds of the line's clock."""

    begun: float
    frame: bytes
    message: PingMessage


class MessageLine:
    """Sends and receives messages on a port. `stop` ends every wait within a twentieth of a second."""

    def __init__(
        self,
        port: Port,
        baud_rate: float,
        byte_gap: float,
        stop: threading.Event,
        elapsed: Callable[[], float] = time.monotonic,
    ) -> None:
        """`baud_rate` is infinite where bytes take no time; `byte_gap` s of silence end an incomplete message.

        `elapsed` is the clock of deadlines and arrivals, in seconds.
        """
        self.elapsed = elapsed
        self._port = port
        self._baud_rate = baud_rate
        self._byte_gap = byte_gap
        self._stop = stop
        self._stream = MessageStream()
        self._arrived: Deque[Arrival] = deque()
        self._reads: Deque[Tuple[int, float]] = deque()
        self._received = 0
        self._last_byte = self.elapsed()

    def send(self, data: bytes) -> float:
        """Send a message; return when its last byte has left, in seconds of the line's clock."""
        self._port.write(data)
        return self.elapsed() + transmission_time(len(data), self._baud_rate)

    def interrupt(self) -> None:
        """Make a head on a serial line stop what it does and listen; it can be sent anything then."""
        self._port.send_break()
        self._port.write(_SPEED_SAMPLE)
        self._stop.wait(_WAKING_TIME)
        while self._port.in_waiting and not self._stop.is_set():
            self._port.read(self._port.in_waiting)
        self._stream = MessageStream()
        self._received = 0
        self._reads.clear()
        self._arrived.clear()

    def drain(self) -> None:
        """Let the head finish a broken message, so that what is broken afterwards is counted anew."""
        deadline = self.elapsed() + _LONGEST_DRAIN
        while not self._stop.wait(_QUIET) and self._port.in_waiting and self.elapsed() < deadline:
            self._read()
        self._stream.reset()
        self.take_broken()

    def receive(self, deadline: float) -> Optional[Arrival]:
        """Return the next message; None when a broken one came, at the deadline or when stopped.

        What arrived while this process stalled is read before the deadline counts.
        """
        while not self._arrived and not self._stop.is_set():
            now = self.elapsed()
            self._read()
            if self._stream.broken or (now >= deadline and not self._arrived):
                break
        return self._arrived.popleft() if self._arrived else None

    def take_broken(self) -> int:
        """Return how many broken messages came since the last call."""
        number, self._stream.broken = self._stream.broken, 0
        return number

    def _read(self) -> None:
        data = self._port.read(max(self._stream.missing, self._port.in_waiting))
        now = self.elapsed()
        if data:
            self._last_byte = now
            self._received += len(data)
            self._reads.append((self._received, now))
            self._arrived.extend(self._arrivals(self._stream.feed(data)))
        elif self._stream.pending and now - self._last_byte >= self._byte_gap:
            self._stream.reset()

    def _arrivals(self, found: List[ParsedMessage]) -> List[Arrival]:
        arrivals: List[Arrival] = []
        for one in reversed(found):
            begun = min(self._begun(one), self._latest_begun(one, arrivals))
            arrivals.append(Arrival(begun, one.frame, one.message))
        if found:
            end = found[-1].offset + len(found[-1].frame)
            while self._reads and self._reads[0][0] <= end:
                self._reads.popleft()
        return arrivals[::-1]

    def _latest_begun(self, parsed: ParsedMessage, later: List[Arrival]) -> float:
        """Return when a message can have begun at the latest: the head listens before it sends the one after it.

        Both have come in one read where this process stalled. `later` are the messages after it, the newest first.
        """
        if not later:
            return math.inf
        following = later[-1]
        samples, period = (getattr(following.message, name, 0) for name in ("number_of_samples", "sample_period"))
        is_copy = following.frame == parsed.frame
        silent = 0.0 if is_copy else samples * period * TICK
        return following.begun - silent - transmission_time(len(parsed.frame), self._baud_rate)

    def _begun(self, parsed: ParsedMessage) -> float:
        """Return the latest time that every read allows: bytes cannot be read before they have been sent."""
        end = parsed.offset + len(parsed.frame)
        sent = [(min(reached, end) - parsed.offset, moment) for reached, moment in self._reads]
        return min(moment - transmission_time(count, self._baud_rate) for count, moment in sent if count > 0)
