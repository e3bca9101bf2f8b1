"""What every benchmark shares: timing a call and printing a table."""

import time
from typing import Callable, List, Tuple

import numpy as np

Row = Tuple[str, str, str]
"""What was measured, the figure with its unit, and what is wanted of it."""


def median_seconds(
    call: Callable[[], object], repeats: int = 20, clock: Callable[[], float] = time.perf_counter
) -> float:
    """Return the median time of a call; time.process_time counts only what this process gets of its core."""
    times = []
    for _ in range(repeats):
        start = clock()
        call()
        times.append(clock() - start)
    return float(np.median(times))


def print_table(rows: List[Row]) -> None:
    """Print rows in columns under a heading."""
    lines = [("figure", "measured", "wanted"), *rows]
    widths = [max(len(line[column]) for line in lines) for column in range(3)]
    for index, line in enumerate(lines):
        print("  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip())
        if index == 0:
            print("  ".join("-" * width for width in widths))
