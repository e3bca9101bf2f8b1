"""What came of one ping."""

from dataclasses import dataclass
from typing import Dict, Optional

from ping360_driver.protocol.replies import Beam


@dataclass
class Outcome:
    """A beam and when its ping left, in seconds of the line's clock, or what came instead; and what else came.

    `timeouts`, `bad_frames`, `refusals` and `interrupted` are pings without a beam. `unexpected_replies` and
    `missing_beams` are as in `Ping360Stats`. `error` says in words what was wrong.
    """

    beam: Optional[Beam] = None
    pinged: float = 0.0
    timeouts: int = 0
    bad_frames: int = 0
    refusals: int = 0
    interrupted: int = 0
    unexpected_replies: int = 0
    missing_beams: int = 0
    error: str = ""

    @property
    def is_over(self) -> bool:
        """Whether the ping has come to any end."""
        return self.beam is not None or bool(self._without_beam())

    def interrupt(self) -> None:
        """Note that the ping ended before its time, unless it has come to another end already; a timeout is none."""
        self.timeouts = 0
        if not self.is_over:
            self.interrupted, self.error = 1, ""

    def counts(self) -> Dict[str, int]:
        """Return what is added to the counts of the device."""
        replies = int(self.beam is not None)
        return {
            "pings": replies + self._without_beam(),
            "replies": replies,
            "timeouts": self.timeouts,
            "bad_frames": self.bad_frames,
            "refusals": self.refusals,
            "interrupted": self.interrupted,
            "unexpected_replies": self.unexpected_replies,
            "missing_beams": self.missing_beams,
        }

    def _without_beam(self) -> int:
        return self.timeouts + self.bad_frames + self.refusals + self.interrupted
