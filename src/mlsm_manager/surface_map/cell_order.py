"""Sorts by cell, then by height, faster than a general sort."""

import numpy as np

from mlsm_manager.surface_map.cell_index import cells_of_keys

_DIGIT_BITS = 16
"""numpy sorts two-byte integers by counting them, ten times faster than by comparing."""
_MOST_DIGITS = 2


def cell_order(cell: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Return the order (n,) that sorts by the key of the cell (n,), then by height (n,); equal ones stay in theirs."""
    if not len(cell):
        return np.empty(0, dtype=np.int64)
    x, y = cells_of_keys(cell).T
    x, y = x - x.min(), y - y.min()
    rows = int(y.max()) + 1
    largest = (int(x.max()) + 1) * rows - 1
    if largest >> (_DIGIT_BITS * _MOST_DIGITS):
        return np.lexsort((height, cell))
    number, order = x * rows + y, np.arange(len(cell))
    for shift in range(0, max(largest.bit_length(), 1), _DIGIT_BITS):
        digit = (number >> shift).astype(np.uint16)
        order = order[np.argsort(digit[order], kind="stable")]
    # Complex numbers sort by their real part first; the stable sort is quick where only neighbours change places.
    by_both = number[order] + 1j * height[order]
    return order[np.argsort(by_both, kind="stable")]
