"""The head on its serial line: sends one command, returns its reply, and counts everything else."""

from dataclasses import dataclass
from typing import Any, List, Optional

from imagenex_852_driver.command import SwitchCommand
from imagenex_852_driver.parameters import ConnectionParameters, ping_leaves, reply_begins
from imagenex_852_driver.reply import ParsedReply, Reply, ReplyKind, ReplyParser
from sonar_driver.device import LineDevice, LineStats
from sonar_driver.port import transmission_time

_SURELY_TOO_EARLY = 0.9  # share of the expected time: too early for any realistic speed of sound
_QUIET = 0.02  # s: a busy line counts as quiet after that; USB adapters pass bytes on in pieces up to 16 ms apart
_LONGEST_DRAIN = 0.2  # s: the longest wait for that
_UNEXPECTED = "a reply came late or twice"
_EARLY = "a reply came before the sound can have returned"


@dataclass(frozen=True)
class DeviceStats(LineStats):
    """Counts since the start.

    `early_replies`: whole replies that began before the sound of the outstanding command can have returned; they are
    dropped. `overruns` and `rejected_switches` are reported by the head in replies that are otherwise valid.
    """

    early_replies: int = 0
    overruns: int = 0
    rejected_switches: int = 0
    problems = {  # noqa: RUF012
        "timeouts": "no reply; check the head's power, the cable, baud_rate and head_id",
        "bad frames": "a broken reply; check the cable",
        "unexpected replies": "a reply came late or twice and was dropped",
        "early replies": "a reply came before the sound can have returned and was dropped; check speed_of_sound, "
        "baud_rate and whether another head is on the line",
        "overruns": "the head lost characters of a command; check the cable",
        "rejected switches": "the head did not accept the switches of a command",
    }


class ReplyWait:
    """Classifies the bytes that arrive after one command; it neither reads nor waits itself.

    All times are of one monotonic clock. The protocol has no sequence numbers: a reply that began before
    sound can have returned answers an earlier command. A byte counts as early only if it was read early,
    so that a stall of the driver never loses a valid reply.
    """

    def __init__(self, command: SwitchCommand, connection: ConnectionParameters, start: float) -> None:
        leaves, begins = ping_leaves(connection), reply_begins(connection, command)
        ends = begins + transmission_time(command.reply_kind.length, connection.baud_rate)
        self.command = command
        self.reply: Optional[Reply] = None
        self.early_replies = 0
        self.unexpected_replies = 0
        self.patience = begins + connection.reply_margin
        self._earliest = start + leaves + _SURELY_TOO_EARLY * (begins - leaves)
        self._length = command.reply_kind.length
        self._byte_gap = connection.byte_gap
        self._deadline = start + self.patience
        self._last_deadline = start + ends + connection.reply_margin + connection.byte_gap
        self._last_byte = float("inf")
        self._early_bytes = 0
        self._early_reply_bytes = 0
        self._received = 0

    @property
    def answer_bytes(self) -> int:
        """Number of received bytes that do not belong to the reply to an earlier command."""
        return max(0, self._received - max(self._early_bytes, self._early_reply_bytes))

    @property
    def missing_bytes(self) -> int:
        """Number of bytes missing from a complete answer; 0 when enough were received."""
        return max(0, self._length - self.answer_bytes)

    def take(self, data: bytes, replies: List[ParsedReply], now: float) -> None:
        """Record the bytes, possibly none, that were read by `now`, and the replies that they completed."""
        self._received += len(data)
        if now < self._earliest:
            self._early_bytes = self._received
        elif data:
            self._last_byte = now
        for offset, reply in replies:
            if offset < self._early_bytes:
                self.early_replies += 1
                self._early_reply_bytes = max(self._early_reply_bytes, offset + reply.kind.length)
            else:
                # Two replies at once were read after a stall; the earlier one is an old reply that the head sent twice.
                self.unexpected_replies += int(self.reply is not None)
                self.reply = reply

    def expired(self, now: float) -> bool:
        return not self.answer_bytes and now >= self._deadline

    def over(self, now: float, pending: bool) -> bool:
        """Return whether waiting any longer is useless; `pending`: whether a reply may have begun."""
        if self.reply is not None or self.expired(now):
            return True
        if not self.answer_bytes:
            return False
        complete = self.missing_bytes == 0 and not pending
        return complete or now - self._last_byte >= self._byte_gap or now >= self._last_deadline

    def mismatch(self) -> str:
        """Return in words how the reply contradicts the command; empty if it does not."""
        command, reply = self.command, self.reply
        compared = (
            ("head identification", command.head_id, reply.head_id),
            ("reply", command.reply_kind.name, reply.kind.name),
            ("range", command.max_range, reply.max_range),
        )
        wrong = [f"{name} {came} instead of {asked}" for name, asked, came in compared if came != asked]
        return f"bad reply: {', '.join(wrong)}" if wrong else ""


@dataclass(frozen=True)
class Ping:
    """A valid reply, the command it answers, and the time at which the ping left, in seconds of the device's clock."""

    stamp: float
    command: SwitchCommand
    reply: Reply


class SonarDevice(LineDevice[SwitchCommand, Ping]):
    """Sends one command at a time and waits for its reply."""

    zero = DeviceStats()

    def __init__(self, connection: ConnectionParameters, *arguments: Any, **options: Any) -> None:
        super().__init__(connection, *arguments, **options)
        self._parser = ReplyParser()

    def _ping(self, command: SwitchCommand) -> Optional[Ping]:
        self._drain()
        stamp = self._clock() + ping_leaves(self.connection)
        wait = ReplyWait(command, self.connection, self.elapsed())
        self._count("pings")
        try:
            self._port.write(command.encode())
            self._collect(wait)
        except BaseException:
            self._count("interrupted")
            raise
        if wait.early_replies:
            self._count("early_replies", _EARLY, wait.early_replies)
        if wait.unexpected_replies:
            self._count("unexpected_replies", _UNEXPECTED, wait.unexpected_replies)
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
        if wait.answer_bytes:
            return max(1, wait.missing_bytes)
        return self._port.in_waiting if wait.expired(now) else max(1, self._port.in_waiting)

    def _judge(self, wait: ReplyWait, stamp: float) -> Optional[Ping]:
        if wait.reply is not None:
            return self._accept(wait, stamp)
        if self.stop.is_set():
            self._count("interrupted")
        elif wait.answer_bytes:
            self._count("bad_frames", f"bad reply: {wait.answer_bytes} bytes, no whole reply")
        else:
            self._count("timeouts", f"no reply within {wait.patience:.2f} s")
            self._await_late_reply()
        return None

    def _accept(self, wait: ReplyWait, stamp: float) -> Optional[Ping]:
        reply = wait.reply
        mismatch = wait.mismatch()
        if mismatch:
            self._count("bad_frames", mismatch)
            return None
        self._count("replies")
        if reply.overrun:
            self._count("overruns", "the head lost characters of a command")
        if not reply.switches_accepted:
            self._count("rejected_switches", "the head did not accept the switches of a command")
        return Ping(stamp, wait.command, reply)

    def _await_late_reply(self) -> None:
        deadline = self.elapsed() + self.connection.late_window
        limit = deadline + transmission_time(ReplyKind.IGX.length, self.connection.baud_rate)
        while not self.stop.is_set():
            now = self.elapsed()
            if now >= limit or (now >= deadline and not self._parser.pending):
                return
            if self._unexpected(self._port.read(max(1, self._port.in_waiting))):
                return

    def _drain(self) -> None:
        """Empty the line before a command; wait until a head that is still sending has finished."""
        deadline = self.elapsed() + _LONGEST_DRAIN
        while self._port.in_waiting and not self.stop.is_set():
            self._unexpected(self._port.read(self._port.in_waiting))
            if self.elapsed() < deadline:
                self.stop.wait(_QUIET)
        self._parser.reset()

    def _unexpected(self, data: bytes) -> int:
        found = len(self._parser.feed(data))
        if found:
            self._count("unexpected_replies", _UNEXPECTED, found)
        return found
