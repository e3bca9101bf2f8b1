"""Where the emulated head points next while it scans by itself, as firmware 3.3 has been seen to do."""

from ping360_driver.protocol.angles import TURN

_HALF_TURN = TURN // 2


class SectorScan:
    """Steps from start to stop; back again in a sector of up to half a turn, from the start again in a wider one."""

    def __init__(self, start: int, stop: int, step: int) -> None:
        self.angle = start
        self._start = start
        self._width = (stop - start) % TURN
        self._step = step
        self._clockwise = True

    def turn(self) -> int:
        """Go to the angle of the next ping; return by how many gradians the head turns."""
        position = (self.angle - self._start) % TURN
        following = position + (self._step if self._clockwise else -self._step)
        if not 0 <= following <= self._width:
            following = self._beyond_the_edge(position)
        self.angle = (self._start + following) % TURN
        return min((following - position) % TURN, (position - following) % TURN)

    def _beyond_the_edge(self, position: int) -> int:
        if self._width > _HALF_TURN:
            return 0
        self._clockwise = not self._clockwise
        return min(max(position + (self._step if self._clockwise else -self._step), 0), self._width)
