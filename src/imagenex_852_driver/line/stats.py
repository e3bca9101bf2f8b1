"""What the driver counts."""

from dataclasses import dataclass, field

from imagenex_852_driver.protocol import ParserCounts
from sonar_driver.line.driver_health import Problem
from sonar_driver.line.stats import LineStats


@dataclass(frozen=True)
class DeviceStats(LineStats):
    """Counts since the start.

    `early_replies`: whole replies that began before the sound of the outstanding command can have returned; they are
    dropped. `overruns` and `rejected_switches` are reported by the head in replies that are otherwise valid. `parser`
    holds the parser's own counts.
    """

    early_replies: int = 0
    overruns: int = 0
    rejected_switches: int = 0
    parser: ParserCounts = field(default_factory=ParserCounts)


PROBLEMS = {
    "timeouts": Problem("timeouts", "no reply; check the head's power, the cable, baud_rate and head_id"),
    "bad_frames": Problem("bad frames", "a broken reply; check the cable"),
    "unexpected_replies": Problem("unexpected replies", "a reply came late or twice and was dropped"),
    "early_replies": Problem(
        "early replies",
        "a reply came before the sound can have returned and was dropped; check speed_of_sound, baud_rate and whether "
        "another head is on the line",
    ),
    "overruns": Problem("overruns", "the head lost characters of a command"),
    "rejected_switches": Problem("rejected switches", "the head did not accept the switches of a command"),
}
"""Counts that should stay zero."""
