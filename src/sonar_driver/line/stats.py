"""What every driver counts."""

from dataclasses import dataclass, replace
from typing import Dict, Generic, TypeVar


@dataclass(frozen=True)
class LineStats:
    """Counts since the start; every ping is counted in exactly one of the four fields after `pings`.

    `timeouts`: nothing was received. `bad_frames`: something was received, but no valid answer. `interrupted`: the
    port was lost or the driver stopped before the answer. `unexpected_replies`: whole replies that answered no
    outstanding command, late or sent twice; they are dropped.
    """

    connected: bool = False
    pings: int = 0
    replies: int = 0
    timeouts: int = 0
    bad_frames: int = 0
    interrupted: int = 0
    unexpected_replies: int = 0
    connections: int = 0
    last_error: str = ""

    @property
    def losses(self) -> int:
        """How often a port that had been open was lost."""
        return max(0, self.connections - int(self.connected))

    def details(self) -> Dict[str, str]:
        """Return what else /diagnostics shows of this sonar."""
        return {}


Stats = TypeVar("Stats", bound=LineStats)


class StatsRecorder(Generic[Stats]):
    """Collects the counts; one thread writes, any thread reads `current`."""

    def __init__(self, zero: Stats) -> None:
        self.current = zero

    def count(self, name: str, error: str = "", number: int = 1) -> None:
        """Increase the count `name`, and store the error if there is one."""
        changes = {name: getattr(self.current, name) + number}
        if error:
            changes["last_error"] = error
        self.current = replace(self.current, **changes)

    def note(self, **values: object) -> None:
        """Set values as they are."""
        self.current = replace(self.current, **values)
