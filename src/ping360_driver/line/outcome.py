"""What came of one ping."""

from dataclasses import dataclass
from typing import Dict, Optional

from ping360_driver.protocol.replies import Beam


@dataclass
class Outcome:
    """A beam and when its ping left, in seconds of the line's clock, or what came instead; and what else came.

    `timeouts`, `bad_frames` and `refusals` are pings without a beam. `unexpected_replies` and `missing_beams` are as in
    `Ping360Stats`. `error` says in words what was wrong.
    """

    beam: Optional[Beam] = None
    pinged: float = 0.0
    timeouts: int = 0
    bad_frames: int = 0
    refusals: int = 0
    unexpected_replies: int = 0
    missing_beams: int = 0
    error: str = ""

    def counts(self) -> Dict[str, int]:
        """Return what is added to the counts of the device."""
        replies = int(self.beam is not None)
        return {
            "pings": replies + self.timeouts + self.bad_frames + self.refusals,
            "replies": replies,
            "timeouts": self.timeouts,
            "bad_frames": self.bad_frames,
            "refusals": self.refusals,
            "unexpected_replies": self.unexpected_replies,
            "missing_beams": self.missing_beams,
        }
