"""The wait for one reply: deadlines, and which of the replies that come is the answer."""

from typing import List, Optional

from imagenex_852_driver.line.connection import ConnectionParameters
from imagenex_852_driver.protocol import ParsedReply, Reply, SwitchCommand

# Share of the time until the reply within which bytes surely come too early, whatever the true speed of sound is.
_SURELY_TOO_EARLY = 0.9


class ReplyWait:
    """Judges what comes after one command, without reading or waiting itself.

    All times are of one monotonic clock. The protocol has no sequence numbers: a reply that began before
    sound can have come back answers an earlier command. A byte counts as early only when it was read early,
    so that a stall of the driver never costs a good reply.
    """

    def __init__(self, command: SwitchCommand, connection: ConnectionParameters, start: float) -> None:
        timing = connection.timing()
        leaves, begins = timing.ping_leaves(), timing.reply_begins(command)
        self.command = command
        self.reply: Optional[Reply] = None
        self.unexpected_replies = 0
        self.patience = begins + connection.reply_margin
        self._earliest = start + leaves + _SURELY_TOO_EARLY * (begins - leaves)
        self._length = command.reply_kind.length
        self._byte_gap = connection.byte_gap
        self._deadline = start + self.patience
        self._last_deadline = start + timing.reply_ends(command) + connection.reply_margin + connection.byte_gap
        self._last_byte = float("inf")
        self._early_bytes = 0
        self._unexpected_bytes = 0
        self._received = 0

    @property
    def answer_bytes(self) -> int:
        """Number of bytes that came and belong to no earlier command's reply."""
        return max(0, self._received - max(self._early_bytes, self._unexpected_bytes))

    @property
    def answered(self) -> bool:
        """Whether anything came that may be an answer."""
        return self.answer_bytes > 0

    @property
    def missing_bytes(self) -> int:
        """Number of bytes that a whole answer still needs; 0 when enough came to make one."""
        return max(0, self._length - self.answer_bytes)

    def take(self, data: bytes, replies: List[ParsedReply], now: float) -> None:
        """Take note of bytes, possibly none, that had been read by `now`, and of replies they completed."""
        self._received += len(data)
        if now < self._earliest:
            self._early_bytes = self._received
        elif data:
            self._last_byte = now
        self._sort(replies)

    def expired(self, now: float) -> bool:
        """Tell whether the answer should have begun by now."""
        return not self.answered and now >= self._deadline

    def over(self, now: float, pending: bool) -> bool:
        """Tell whether waiting is useless; `pending` is whether a reply may have begun."""
        if self.reply is not None or self.expired(now):
            return True
        if not self.answered:
            return False
        complete = self.missing_bytes == 0 and not pending
        return complete or now - self._last_byte >= self._byte_gap or now >= self._last_deadline

    def mismatch(self) -> str:
        """Say what the reply and the command disagree about; empty when they agree."""
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
                self.unexpected_replies += 1
                self._unexpected_bytes = max(self._unexpected_bytes, offset + reply.kind.length)
            else:
                # Two at once were read after a stall; the earlier one is an old reply that the head sent twice.
                self.unexpected_replies += int(self.reply is not None)
                self.reply = reply
