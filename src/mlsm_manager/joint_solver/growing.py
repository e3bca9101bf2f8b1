"""Arrays that grow at their end at constant cost per row."""

import numpy as np

_FIRST_CAPACITY = 256


class GrowingArray:
    """Rows of one shape; `values` is a view of those that were appended."""

    def __init__(self, *shape: int) -> None:
        self._rows = np.empty((_FIRST_CAPACITY, *shape))
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def values(self) -> np.ndarray:
        """(n, ...) view; valid until the next append."""
        return self._rows[: self._count]

    def replace_from(self, start: int, rows: np.ndarray) -> None:
        """Put rows (m, ...) in place of those from `start` on."""
        self._count = start
        self.extend(rows)

    def shorten(self, count: int) -> None:
        """Keep the first `count` rows."""
        self._count = min(count, self._count)

    def extend(self, rows: np.ndarray) -> None:
        """Append rows (m, ...)."""
        count = self._count + len(rows)
        if count > len(self._rows):
            larger = np.empty((max(count, 2 * len(self._rows)), *self._rows.shape[1:]))
            larger[: self._count] = self.values
            self._rows = larger
        self._rows[self._count : count] = rows
        self._count = count
