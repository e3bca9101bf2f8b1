"""Arrays that grow to gigabytes without a pause."""

import mmap
from typing import Tuple

import numpy as np

_COPIED_BYTES = 1 << 22  # copying up to 4 MB takes about a millisecond, and a small array needs no mapping of its own
_PRIVATE = getattr(mmap, "MAP_PRIVATE", 0) | getattr(mmap, "MAP_ANONYMOUS", 0)
"""Both 0 where the system has no such mappings: arrays are then copied whenever they grow."""


class LargeArray:
    """The first axis grows. `values` holds the array with what is reserved behind it, which may be anything.

    Beyond some megabytes the operating system moves the pages of the array to a larger range of addresses and copies
    nothing; pages that were never written to take no memory. `values` must be asked for anew after each `reserve`.
    """

    def __init__(self, length: int, shape: Tuple[int, ...], dtype: type) -> None:
        """Reserve `length` elements of `shape`."""
        self._shape, self._dtype = shape, np.dtype(dtype)
        self._memory = None
        self.values = self._new(length)

    def reserve(self, length: int) -> None:
        """Make `values` at least so long; it at least doubles where it must grow."""
        held = len(self.values)
        if length <= held:
            return
        length = max(length, 2 * held)
        if self._memory is None or not self._moved(length):
            before = self.values
            self.values = self._new(length)
            self.values[:held] = before

    def _bytes(self, length: int) -> int:
        return length * int(np.prod(self._shape, dtype=np.int64)) * self._dtype.itemsize

    def _new(self, length: int) -> np.ndarray:
        self._memory = None
        if self._bytes(length) <= _COPIED_BYTES or not _PRIVATE:
            return np.empty((length, *self._shape), dtype=self._dtype)
        self._memory = mmap.mmap(-1, self._bytes(length), flags=_PRIVATE)
        if hasattr(mmap, "MADV_HUGEPAGE"):
            self._memory.madvise(mmap.MADV_HUGEPAGE)
        return self._view(length)

    def _view(self, length: int) -> np.ndarray:
        # Arrays of numpy before 1.20 do not keep the mapping from being moved, but the memoryview that they hold does.
        return np.frombuffer(memoryview(self._memory), dtype=self._dtype).reshape(length, *self._shape)

    def _moved(self, length: int) -> bool:
        """Move the pages; return whether that was possible: not where somebody else still holds the array."""
        held, self.values = len(self.values), None
        try:
            self._memory.resize(self._bytes(length))
        except (BufferError, SystemError):
            self.values = self._view(held)
            return False
        self.values = self._view(length)
        return True
