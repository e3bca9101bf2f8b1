"""Rows with times that a bounded memory holds: the older they are, the fewer are left."""

from typing import Callable, List, Sequence

import numpy as np

from web_page.messages import Kind, rows_bytes

_CHUNK = 32  # rows that are sent together: few, because the newest chunk goes again with each new row
_MOST = 2048  # rows; when they are there, every second one goes


class History:
    """Keeps rows of numbers, each with its time [s] first, and shows them in chunks."""

    def __init__(self, kind: Kind, least: float, put: Callable[[int, bytes], None]) -> None:
        """`least`: s between two rows. `put` takes the number of a chunk that changed, and its bytes."""
        self._kind, self._first_least, self._put = kind, least, put
        self.clear()

    def clear(self) -> None:
        """Forget all."""
        self._rows: List[Sequence[float]] = []
        self._least = self._first_least

    def __len__(self) -> int:
        return len(self._rows)

    def take(self, row: Sequence[float]) -> bool:
        """Keep a row unless it follows the last one too soon; return whether it was kept."""
        if self._rows and row[0] - self._rows[-1][0] < self._least:
            return False
        self._rows.append(row)
        if len(self._rows) < _MOST:
            self._show((len(self._rows) - 1) // _CHUNK)
            return True
        before = self._chunks()
        self._rows, self._least = self._rows[1::2], max(2.0 * self._least, 1e-3)
        for chunk in range(before):
            self._show(chunk)
        return True

    def _chunks(self) -> int:
        return -(-len(self._rows) // _CHUNK)

    def _show(self, chunk: int) -> None:
        rows = np.array(self._rows[chunk * _CHUNK : (chunk + 1) * _CHUNK], dtype=np.float64)
        self._put(chunk, rows_bytes(self._kind, chunk, rows.reshape(-1, len(self._rows[0]))))
