"""The wait for one reply: deadlines, and which of the received replies is the answer."""

from typing import List, Optional

from imagenex_852_driver.line.connection import ConnectionParameters
from imagenex_852_driver.protocol import ParsedReply, Reply, SwitchCommand

# Bytes that arrive within this share of the expected time are too early for any realistic speed of sound.
_SURELY_TOO_EARLY = 0.9


class ReplyWait:
    """Classifies the bytes that arrive after one command; it neither reads nor waits itself.

    All times are of one monotonic clock. The protocol has no sequence numbers: a reply that began before
    sound can have returned answers an earlier command. A byte counts as early only if it was read early,
    so that a stall of the driver never loses a valid reply.
    """

    def __init__(self, command: SwitchCommand, connection: ConnectionParameters, start: float) -> None:
        timing = connection.timing()
        leaves, begins = timing.ping_leaves(), timing.reply_begins(command)
        self.command = command
        self.reply: Optional[Reply] = None
        self.early_replies = 0
        self.unexpected_replies = 0
        self.patience = begins + connection.reply_margin
        self._earliest = start + leaves + _SURELY_TOO_EARLY * (begins - leaves)
        self._length = command.reply_kind.length
        self._byte_gap = connection.byte_gap
        self._deadline = start + self.patience
        self._last_deadline = start + timing.reply_ends(command) + connection.reply_margin + connection.byte_gap
        self._last_byte = float("inf")
        self._early_bytes = 0
        self._early_reply_bytes = 0
        self._received = 0

    @property
    def answer_bytes(self) -> int:
        """Number of received bytes that do not belong to the reply to an earlier command."""
        return max(0, self._received - max(self._early_bytes, self._early_reply_bytes))

    @property
    def answered(self) -> bool:
        """Whether anything was received that may be the answer."""
        return self.answer_bytes > 0

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
        self._sort(replies)

    def expired(self, now: float) -> bool:
        """Return whether the answer should have begun by now."""
        return not self.answered and now >= self._deadline

    def over(self, now: float, pending: bool) -> bool:
        """Return whether waiting any longer is useless; `pending`: whether a reply may have begun."""
        if self.reply is not None or self.expired(now):
            return True
        if not self.answered:
            return False
        complete = self.missing_bytes == 0 and not pending
        return complete or now - self._last_byte >= self._byte_gap or now >= self._last_deadline

    def mismatch(self) -> str:
        """Return in words how the reply contradicts the command; empty if it does not."""
        asked = (self.command.head_id, self.command.reply_kind, self.command.max_range)
        came = (self.reply.head_id, self.reply.kind, self.reply.max_range)
        names = ("head identification", "reply", "range")
        wrong = [
            f"{name} {getattr(is_, 'name', is_)} instead of {getattr(should, 'name', should)}"
            for name, should, is_ in zip(names, asked, came)
            if should != is_
        ]
        return f"bad reply: {', '.join(wrong)}" if wrong else ""

    def _sort(self, replies: List[ParsedReply]) -> None:
        for offset, reply in replies:
            if offset < self._early_bytes:
                self.early_replies += 1
                self._early_reply_bytes = max(self._early_reply_bytes, offset + reply.kind.length)
            else:
                # Two replies at once were read after a stall; the earlier one is an old reply that the head sent twice.
                self.unexpected_replies += int(self.reply is not None)
                self.reply = reply
