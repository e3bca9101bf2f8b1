"""The driver's state for /diagnostics, from the counts of the serial device."""

import time
from dataclasses import replace
from typing import Callable

from imagenex_852_driver.line.stats import DeviceStats
from node_support.health import Health, HealthReport, Level

# Counts of `DeviceStats` that are problems: their names and what the user should check.
_PROBLEMS = {
    "timeouts": ("timeouts", "no reply; check the head's power, the cable, baud_rate and head_id"),
    "bad_frames": ("bad frames", "a broken reply; check the cable"),
    "unexpected_replies": ("unexpected replies", "a reply came late or twice and was dropped"),
    "early_replies": (
        "early replies",
        "a reply came before the sound can have returned and was dropped; check speed_of_sound, baud_rate and whether "
        "another head is on the line",
    ),
    "overruns": ("overruns", "the head lost characters of a command"),
    "rejected_switches": ("rejected switches", "the head did not accept the switches of a command"),
}


class DriverHealth(Health):
    """Reports the device's counts; ERROR while it is not connected."""

    def __init__(
        self,
        warn: Callable[[str], None],
        read_stats: Callable[[], DeviceStats],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__("imagenex_852_driver", warn, clock)
        self._read_stats = read_stats
        self._seen = DeviceStats()

    def report(self) -> HealthReport:
        """Return the state since the start, with rates since the previous report."""
        stats = self._read_stats()
        self._note(stats)
        report = super().report()
        if stats.connected:
            return report
        return replace(report, level=Level.ERROR, text=f"not connected: {stats.last_error or 'not opened yet'}")

    def _note(self, stats: DeviceStats) -> None:
        self.show("connected", str(stats.connected).lower())
        self.show("last error", stats.last_error)
        self.show("connections", str(stats.connections))
        self.total("pings", stats.pings)
        self.total("replies", stats.replies)
        for field, (kind, hint) in _PROBLEMS.items():
            self._note_problem(kind, hint, getattr(stats, field), getattr(self._seen, field))
        self._note_problem("losses of the port", stats.last_error, _losses(stats), _losses(self._seen))
        self._seen = stats

    def _note_problem(self, kind: str, detail: str, total: int, seen: int) -> None:
        if total > seen:
            self.problem(kind, detail, total - seen)
        self.show(kind, str(total))


def _losses(stats: DeviceStats) -> int:
    return max(0, stats.connections - int(stats.connected))
