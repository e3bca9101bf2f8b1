"""How long a ping takes on the line and in the water; used by both driver and emulated head."""

from dataclasses import dataclass

from imagenex_852_driver.protocol import SwitchCommand
from imagenex_852_driver.protocol.command import LENGTH as COMMAND_LENGTH
from sonar_driver.line.timing import transmission_time


@dataclass(frozen=True)
class LineTiming:
    """Baud rate (8N1) and speed of sound; all results are seconds after the command's first bit."""

    baud_rate: int = 115200
    speed_of_sound: float = 1500.0

    def transmission(self, byte_count: int) -> float:
        """Return the time that `byte_count` bytes take on the line."""
        return transmission_time(byte_count, self.baud_rate)

    def ping_leaves(self) -> float:
        """Return when the head transmits: it acts on the last byte of the command."""
        return self.transmission(COMMAND_LENGTH)

    def reply_begins(self, command: SwitchCommand) -> float:
        """Return when the reply can leave the head at the earliest: after the farthest echo and the switch delay."""
        travel = 2 * command.max_range / self.speed_of_sound
        return self.ping_leaves() + travel + command.switch_delay_ms / 1000

    def reply_ends(self, command: SwitchCommand) -> float:
        """Return when the last byte of the reply can have arrived at the earliest."""
        return self.reply_begins(command) + self.transmission(command.reply_kind.length)
