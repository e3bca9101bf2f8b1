"""What the threshold has to know of all strengths of a cloud, and which points are above it: loops over every bin."""

from dataclasses import dataclass
from typing import Callable, NamedTuple

import numpy as np

from node_support.kernels import Kernel
from node_support.numba_cache import prepare_cache
from sonar_processing.cloud import IntensityCloud, are_finite
from sonar_processing.filters.otsu import HIGHEST_LEVEL, level_histogram, threshold_of_levels


@dataclass(frozen=True)
class StrengthCounts:
    """The finite points of a cloud by strength.

    levels: (256,) int64, how many of the strengths above 0 lie in each integer level, those above 255 in the last.
    silent: number of the other points. lowest, highest: of all strengths, infinite without a point. echoes_differ:
    whether there are different strengths above 0.
    """

    levels: np.ndarray
    silent: int
    lowest: float
    highest: float
    echoes_differ: bool

    @property
    def is_empty(self) -> bool:
        """Whether the cloud has no finite point."""
        return self.lowest > self.highest

    @property
    def all_levels(self) -> np.ndarray:
        """(256,) int64: `levels` with the silent points in level 0."""
        levels = self.levels.copy()
        levels[0] += self.silent
        return levels


class StrengthLoops(NamedTuple):
    """The loops of one kernel.

    count: takes a cloud. strong: takes a cloud and a threshold, and returns the numbers (m,) of the finite points above
    it. separate: takes levels (256,), not all 0, and returns Otsu's threshold.
    """

    count: Callable[[IntensityCloud], StrengthCounts]
    strong: Callable[[IntensityCloud, float], np.ndarray]
    separate: Callable[[np.ndarray], float]


def strength_loops(kernel: Kernel) -> StrengthLoops:
    """Return the loops of a kernel. Raises ImportError for NUMBA without numba."""
    if kernel is Kernel.NUMPY:
        return StrengthLoops(count_strengths, strong_points, threshold_of_levels)
    prepare_cache()
    from sonar_processing.filters import compiled_strengths

    return StrengthLoops(_count_compiled, _strong_compiled, compiled_strengths.threshold_of_levels)


def count_strengths(cloud: IntensityCloud) -> StrengthCounts:
    """Count the finite points of a cloud."""
    valid = cloud.valid
    strengths = np.ascontiguousarray(cloud.points[:, 3])
    return counts_of(strengths if valid.all() else strengths[valid])


def counts_of(strengths: np.ndarray) -> StrengthCounts:
    """Count finite strengths (n,)."""
    if not strengths.size:
        return StrengthCounts(np.zeros(HIGHEST_LEVEL + 1, np.int64), 0, np.inf, -np.inf, False)
    levels, highest = level_histogram(strengths), strengths.max()
    # To count takes a tenth of the time of picking the echoes out.
    echoes = int(np.count_nonzero(strengths > 0))
    silent = strengths.size - echoes
    levels[0] -= silent
    echoes_differ = echoes > 0 and int(np.count_nonzero(strengths == highest)) < echoes
    return StrengthCounts(levels, silent, float(strengths.min()), float(highest), echoes_differ)


def strong_points(cloud: IntensityCloud, threshold: float) -> np.ndarray:
    """Return the numbers (m,) of the finite points above a threshold."""
    with np.errstate(invalid="ignore"):
        above = np.flatnonzero(np.ascontiguousarray(cloud.points[:, 3]) > np.float32(threshold))
    finite = are_finite(cloud.points.take(above, axis=0), cloud.time_stamps.take(above))
    return above if finite.all() else above[finite]


def _count_compiled(cloud: IntensityCloud) -> StrengthCounts:
    from sonar_processing.filters.compiled_strengths import count_strengths

    counts, ends = count_strengths(np.ascontiguousarray(cloud.points), np.ascontiguousarray(cloud.time_stamps))
    lowest, highest, weakest = ends.tolist()
    return StrengthCounts(counts[:-1], int(counts[-1]), lowest, highest, weakest < highest)


def _strong_compiled(cloud: IntensityCloud, threshold: float) -> np.ndarray:
    from sonar_processing.filters.compiled_strengths import strong_points

    points, stamps = np.ascontiguousarray(cloud.points), np.ascontiguousarray(cloud.time_stamps)
    return strong_points(points, stamps, np.float32(threshold))
