"""Where the head points next when the driver asks for every single ping."""

from typing import Optional

from ping360_driver.protocol.angles import TURN
from ping360_driver.protocol.scan_command import ScanCommand


class SectorWalk:
    """Goes through a full turn clockwise without end, and through a sector to and fro, from one edge to the other."""

    def __init__(self) -> None:
        self._last: Optional[int] = None
        self._clockwise = True

    def next(self, command: ScanCommand) -> int:
        """Return the angle of the next ping, in gradians from 0 to 399."""
        self._last = self._following(command)
        return self._last

    def _following(self, command: ScanCommand) -> int:
        if self._last is None:
            return command.start
        if command.is_full_turn:
            return (self._last + command.step) % TURN
        position = (self._last - command.start) % TURN
        if position > command.width:
            self._clockwise = True
            return command.start
        if position == (command.width if self._clockwise else 0):
            self._clockwise = not self._clockwise
        position += command.step if self._clockwise else -command.step
        return (command.start + min(max(position, 0), command.width)) % TURN
