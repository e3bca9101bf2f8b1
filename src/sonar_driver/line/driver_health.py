"""What every driver counts, and a driver's state for /diagnostics made of it."""

import time
from dataclasses import dataclass, replace
from typing import Callable, ClassVar, Dict, Mapping

from node_support.health import Health, HealthReport, Level


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

    problems: ClassVar[Mapping[str, str]] = {}
    """What to check when a count that should stay zero does not, by the name of its field with spaces."""

    def details(self) -> Dict[str, str]:
        """Return what else /diagnostics shows of this sonar."""
        return {}


class DriverHealth(Health):
    """Reports the device's counts; ERROR while it is not connected."""

    def __init__(
        self,
        name: str,
        warn: Callable[[str], None],
        read_stats: Callable[[], LineStats],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`read_stats` returns the newest counts."""
        super().__init__(name, warn, clock)
        self._read_stats = read_stats
        self._seen: Dict[str, int] = {}

    def report(self) -> HealthReport:
        """Return the state since the start, with rates since the previous report."""
        stats = self._read_stats()
        self._note(stats)
        report = super().report()
        if stats.connected:
            return report
        return replace(report, level=Level.ERROR, text=f"not connected: {stats.last_error or 'not opened yet'}")

    def _note(self, stats: LineStats) -> None:
        self.show("connected", str(stats.connected).lower())
        self.show("last error", stats.last_error)
        self.show("connections", str(stats.connections))
        self.total("pings", stats.pings)
        self.total("replies", stats.replies)
        for name, value in stats.details().items():
            self.show(name, value)
        for kind, hint in stats.problems.items():
            self._note_problem(kind, hint, getattr(stats, kind.replace(" ", "_")))
        self._note_problem("losses of the port", stats.last_error, stats.losses)

    def _note_problem(self, kind: str, detail: str, total: int) -> None:
        seen = self._seen.get(kind, 0)
        if total > seen:
            self.problem(kind, detail, total - seen)
        self._seen[kind] = total
        self.show(kind, str(total))
