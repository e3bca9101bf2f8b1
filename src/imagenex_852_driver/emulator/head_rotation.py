"""How the emulated transducer turns: sectors, full revolutions, step size and direction."""

from imagenex_852_driver.protocol import SwitchCommand
from imagenex_852_driver.protocol.angles import AHEAD

_TURN = 2400  # Head positions in a full turn, 0.15 deg each (manufacturer's specification)


class HeadRotation:
    """The transducer's position, in the head's units (0.15 deg, clockwise, 1400 ahead).

    In a sector the head goes back and forth; with 360 deg it turns without end. A change of the command's
    reverse bit reverses it. A head that is outside the sector steps towards it.
    """

    def __init__(self) -> None:
        self.position = AHEAD
        self.clockwise = True
        self._reverse = False

    def obey(self, command: SwitchCommand) -> None:
        """Adopt the direction of a command, before the ping."""
        if command.reverse != self._reverse:
            self._reverse = command.reverse
            self.clockwise = not self.clockwise

    def step(self, command: SwitchCommand) -> None:
        """Turn to the position of the next ping."""
        width = _positions(command.sector_width_deg)
        low = AHEAD + _positions(command.train_angle_deg) - width // 2
        size = _positions(command.step_size_deg)
        if not size:
            return
        if not low <= self.position <= low + width:
            self._approach(low, low + width, size)
        elif width == _TURN:
            self._go_round(low, size)
        else:
            self._go_to_and_fro(low, low + width, size)

    def _approach(self, low: int, high: int, size: int) -> None:
        self.clockwise = self.position < low
        target = low if self.clockwise else high
        distance = min(size, abs(target - self.position))
        self.position += distance if self.clockwise else -distance

    def _go_round(self, low: int, size: int) -> None:
        self.position = low + (self.position - low + (size if self.clockwise else -size)) % _TURN

    def _go_to_and_fro(self, low: int, high: int, size: int) -> None:
        limit = high if self.clockwise else low
        if self.position == limit:
            self.clockwise = not self.clockwise
            limit = high if self.clockwise else low
        distance = min(size, abs(limit - self.position))
        self.position += distance if self.clockwise else -distance


def _positions(degrees: int) -> int:
    return degrees * 20 // 3
