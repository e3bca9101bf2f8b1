"""What the driver counts."""

from dataclasses import dataclass, field, replace

from imagenex_852_driver.protocol import ParserCounts


@dataclass(frozen=True)
class DeviceStats:
    """Counts since the start; every ping is counted in exactly one of the four fields after `pings`.

    `timeouts`: nothing was received. `bad_frames`: something was received, but no valid answer. `interrupted`: the
    port was lost or the driver stopped before the answer. `unexpected_replies`: whole replies that answered no
    outstanding command, late or sent twice. `early_replies`: whole replies that began before the sound of the
    outstanding command can have returned. Both are dropped. `overruns` and `rejected_switches` are reported by
    the head in replies that are otherwise valid. `parser` holds the parser's own counts.
    """

    connected: bool = False
    pings: int = 0
    replies: int = 0
    timeouts: int = 0
    bad_frames: int = 0
    interrupted: int = 0
    unexpected_replies: int = 0
    early_replies: int = 0
    overruns: int = 0
    rejected_switches: int = 0
    connections: int = 0
    last_error: str = ""
    parser: ParserCounts = field(default_factory=ParserCounts)


class StatsRecorder:
    """Collects the counts; one thread writes, any thread reads `current`."""

    def __init__(self) -> None:
        self.current = DeviceStats()

    def count(self, name: str, error: str = "", number: int = 1) -> None:
        """Increase the count `name`, and store the error if there is one."""
        changes = {name: getattr(self.current, name) + number}
        if error:
            changes["last_error"] = error
        self.current = replace(self.current, **changes)

    def note(self, **values: object) -> None:
        """Set values as they are."""
        self.current = replace(self.current, **values)
