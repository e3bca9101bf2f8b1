"""The figures of scan matching."""

from typing import List

from benchmarks import matching_false, matching_moves, matching_moving, matching_starts
from benchmarks.table import Row


def rows(first_seed: int = 0) -> List[Row]:
    """Return all of them, drawn with the seeds from `first_seed` on; some minutes."""
    parts = (matching_moves, matching_starts, matching_moving, matching_false)
    return [row for part in parts for row in part.rows(first_seed)]
