"""Several ways to do the same, timed in turn so that all of them see the same machine."""

import time
from importlib.util import find_spec
from typing import Callable, Dict, List

import numpy as np

from benchmarks.table import Row
from node_support.kernels import Kernel

OURS = "ours"
_EVEN = 0.05  # Ratios as near to 1 as this are no difference on a machine that others use too


def kernels() -> List[Kernel]:
    """Return the kernels that can be measured: without numba only NUMPY."""
    return [kernel for kernel in Kernel if kernel is Kernel.NUMPY or find_spec("numba") is not None]


def seconds_in_turn(calls: Dict[str, Callable[[], object]], repeats: int) -> Dict[str, np.ndarray]:
    """Return the CPU seconds (repeats,) of each call; a first round, which loads and fills caches, is left out."""
    seconds: Dict[str, List[float]] = {name: [] for name in calls}
    for turn in range(repeats + 1):
        for name, call in calls.items():
            start = time.process_time()
            call()
            if turn:
                seconds[name].append(time.process_time() - start)
    return {name: np.array(values) for name, values in seconds.items()}


def comparison_rows(task: str, calls: Dict[str, Callable[[], object]], repeats: int = 15) -> List[Row]:
    """Return a row of our CPU time and one for each other way: its time over ours, and whether we lose.

    `calls` holds OURS. The spread is the lower and the upper quartile of the ratios of one round each.
    """
    seconds = seconds_in_turn(calls, repeats)
    ours = seconds.pop(OURS)
    rows = [(task, f"{1e3 * float(np.median(ours)):.2f} ms of CPU", "")]
    return rows + [(f"{task}: {name} over ours", *ratio_figure(theirs / ours)) for name, theirs in seconds.items()]


def ratio_figure(ratios: np.ndarray) -> tuple:
    """Return the median ratio with its quartiles as text, and who is faster."""
    low, middle, high = np.percentile(ratios, [25, 50, 75])
    verdict = "even" if abs(middle - 1.0) <= _EVEN else "we win" if middle > 1.0 else "we lose"
    return f"{middle:.2f} ({low:.2f} to {high:.2f})", verdict
