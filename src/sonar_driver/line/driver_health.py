"""A driver's state for /diagnostics, from the counts of its device."""

import time
from dataclasses import replace
from typing import Callable, Dict, Mapping, NamedTuple

from node_support.health import Health, HealthReport, Level
from sonar_driver.line.stats import LineStats


class Problem(NamedTuple):
    """A count that should stay zero: its name, and what the user should check when it does not."""

    name: str
    hint: str


class DriverHealth(Health):
    """Reports the device's counts; ERROR while it is not connected."""

    def __init__(
        self,
        name: str,
        problems: Mapping[str, Problem],
        warn: Callable[[str], None],
        read_stats: Callable[[], LineStats],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`problems` are those of the counts of `read_stats` that should stay zero, by their fields."""
        super().__init__(name, warn, clock)
        self._problem_table = problems
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
        for field, (kind, hint) in self._problem_table.items():
            self._note_problem(kind, hint, getattr(stats, field))
        self._note_problem("losses of the port", stats.last_error, stats.losses)

    def _note_problem(self, kind: str, detail: str, total: int) -> None:
        seen = self._seen.get(kind, 0)
        if total > seen:
            self.problem(kind, detail, total - seen)
        self._seen[kind] = total
        self.show(kind, str(total))
