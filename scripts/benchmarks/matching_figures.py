"""The figures of scan matching."""

from typing import List

from benchmarks import matching_false, matching_moves, matching_moving, matching_starts
from benchmarks.table import Row


def rows() -> List[Row]:
    """Return all of them; some minutes."""
    return [*matching_moves.rows(), *matching_starts.rows(), *matching_moving.rows(), *matching_false.rows()]
