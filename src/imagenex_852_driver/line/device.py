"""The head on its serial line: sends one command, returns its reply, and counts everything else."""

import threading
import time
from dataclasses import dataclass
from typing import Callable, Iterator, Optional

from imagenex_852_driver.line.connection import ConnectionParameters
from imagenex_852_driver.line.reply_wait import ReplyWait
from imagenex_852_driver.line.stats import DeviceStats
from imagenex_852_driver.protocol import Reply, ReplyKind, ReplyParser, SwitchCommand
from sonar_driver.line.device import LineDevice
from sonar_driver.line.port import Port, open_port

# A busy line counts as quiet after a pause of _QUIET: USB adapters pass bytes on in pieces up to 16 ms apart.
# _LONGEST_DRAIN is the longest wait for that. Both in seconds.
_QUIET = 0.02
_LONGEST_DRAIN = 0.2
_UNEXPECTED = "a reply came late or twice"
_EARLY = "a reply came before the sound can have returned"


@dataclass(frozen=True)
class Ping:
    """A valid reply, the command it answers, and the time at which the ping left, in seconds of the device's clock."""

    stamp: float
    command: SwitchCommand
    reply: Reply


class SonarDevice(LineDevice[SwitchCommand, Ping]):
    """Sends one command at a time and waits for its reply."""

    def __init__(
        self,
        connection: ConnectionParameters,
        stop: Optional[threading.Event] = None,
        clock: Callable[[], float] = time.time,
        elapsed: Callable[[], float] = time.monotonic,
        opener: Callable[[str, int], Port] = open_port,
    ) -> None:
        """As `LineDevice` takes them."""
        super().__init__(connection, DeviceStats(), stop, clock, elapsed, opener)
        self._timing = connection.timing()
        self._parser = ReplyParser()

    def _ping(self, command: SwitchCommand) -> Optional[Ping]:
        self._drain()
        stamp = self._clock() + self._timing.ping_leaves()
        wait = ReplyWait(command, self.connection, self.elapsed())
        self._recorder.count("pings")
        try:
            self._port.write(command.encode())
            self._collect(wait)
        except BaseException:
            self._recorder.count("interrupted")
            raise
        finally:
            self._recorder.note(parser=self._parser.counts)
        if wait.early_replies:
            self._recorder.count("early_replies", _EARLY, wait.early_replies)
        if wait.unexpected_replies:
            self._recorder.count("unexpected_replies", _UNEXPECTED, wait.unexpected_replies)
        return self._judge(wait, stamp)

    def _collect(self, wait: ReplyWait) -> None:
        while wait.reply is None and not self.stop.is_set():
            # Taken before the read, so that bytes that arrived while this process stalled are read before it gives up.
            now = self.elapsed()
            data = self._port.read(self._bytes_to_read(wait, now))
            wait.take(data, self._parser.feed(data), self.elapsed())
            if wait.over(now, self._parser.pending):
                break

    def _bytes_to_read(self, wait: ReplyWait, now: float) -> int:
        """Return how many bytes to wait for: first a single one, to notice in time whether it arrived too early."""
        if wait.answered:
            return max(1, wait.missing_bytes)
        return self._port.in_waiting if wait.expired(now) else max(1, self._port.in_waiting)

    def _judge(self, wait: ReplyWait, stamp: float) -> Optional[Ping]:
        if wait.reply is not None:
            return self._accept(wait, stamp)
        if self.stop.is_set():
            self._recorder.count("interrupted")
        elif wait.answered:
            self._recorder.count("bad_frames", f"bad reply: {wait.answer_bytes} bytes, no whole reply")
        else:
            self._recorder.count("timeouts", f"no reply within {wait.patience:.2f} s")
            self._await_late_reply()
        return None

    def _accept(self, wait: ReplyWait, stamp: float) -> Optional[Ping]:
        reply = wait.reply
        mismatch = wait.mismatch()
        if mismatch:
            self._recorder.count("bad_frames", mismatch)
            return None
        self._recorder.count("replies")
        if reply.overrun:
            self._recorder.count("overruns", "the head lost characters of a command")
        if not reply.switches_accepted:
            self._recorder.count("rejected_switches", "the head did not accept the switches of a command")
        return Ping(stamp, wait.command, reply)

    def _await_late_reply(self) -> None:
        deadline = self.elapsed() + self.connection.late_window
        limit = deadline + self._timing.transmission(ReplyKind.IGX.length)
        while not self.stop.is_set():
            now = self.elapsed()
            if now >= limit or (now >= deadline and not self._parser.pending):
                return
            if self._unexpected(self._port.read(max(1, self._port.in_waiting))):
                return

    def _drain(self) -> None:
        """Empty the line before a command; wait until a head that is still sending has finished."""
        deadline = self.elapsed() + _LONGEST_DRAIN
        for data in self._waiting():
            self._unexpected(data)
            if self.elapsed() < deadline:
                self.stop.wait(_QUIET)
        self._parser.reset()

    def _unexpected(self, data: bytes) -> int:
        found = len(self._parser.feed(data))
        if found:
            self._recorder.count("unexpected_replies", _UNEXPECTED, found)
        return found

    def _waiting(self) -> Iterator[bytes]:
        while self._port.in_waiting and not self.stop.is_set():
            yield self._port.read(self._port.in_waiting)
