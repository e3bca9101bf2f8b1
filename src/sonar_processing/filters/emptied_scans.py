"""Notices a stage that removes everything, scan after scan."""

from typing import Optional

# Silence of a few scans is usual: a vehicle leaves the reach of all walls, or turns its head away.
SCANS_IN_A_ROW = 10


class EmptiedScans:
    """Counts the scans in a row that came with points and left without any."""

    def __init__(self) -> None:
        self._in_a_row = 0

    def take(self, points_in: int, points_out: int) -> Optional[int]:
        """Note a scan; return how many in a row lost all their points at every tenth of them, None otherwise.

        A scan that comes without points says nothing about the stage and is not counted.
        """
        if points_in == 0:
            return None
        self._in_a_row = 0 if points_out else self._in_a_row + 1
        return self._in_a_row if self._in_a_row and self._in_a_row % SCANS_IN_A_ROW == 0 else None
