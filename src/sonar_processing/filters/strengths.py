"""What the threshold has to know of all strengths of a cloud, and which points are above it: loops over every bin."""

from dataclasses import dataclass
from typing import Callable, NamedTuple

import numpy as np

from node_support.kernels import Kernel
from sonar_processing.cloud import IntensityCloud
from sonar_processing.filters.otsu import HIGHEST_LEVEL, level_histogram, threshold_of_levels


@dataclass(frozen=True)
class StrengthCounts:
    """The finite points of a cloud by strength.

    levels: (256,) int64, how many of the strengths above 0 lie in each integer level, those above 255 in the last.
    silent: number of the other points. lowest, highest: of all strengths. weakest: of those above 0. They are infinite
    where there is no such point.
    """

    levels: np.ndarray
    silent: int
    lowest: float
    highest: float
    weakest: float

    @property
    def is_empty(self) -> bool:
        """Whether the cloud has no finite point."""
        return self.lowest > self.highest

    @property
    def echoes_differ(self) -> bool:
        """Whether there are different strengths above 0."""
        return self.weakest < self.highest

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
    from sonar_processing.filters import compiled_strengths

    return StrengthLoops(_count_compiled, _strong_compiled, compiled_strengths.threshold_of_levels)


def count_strengths(cloud: IntensityCloud) -> StrengthCounts:
    """Count the finite points of a cloud."""
    valid = cloud.valid
    strengths = np.ascontiguousarray(cloud.points[:, 3])
    return counts_of(strengths if valid.all() else strengths[valid])


def counts_of(strengths: np.ndarray) -> StrengthCounts:
    """Count finite strengths (n,)."""
    # By index, because a mask with many changes takes four times as long.
    echoes = strengths.take(np.flatnonzero(strengths > 0))
    return StrengthCounts(
        level_histogram(echoes) if echoes.size else np.zeros(HIGHEST_LEVEL + 1, np.int64),
        strengths.size - echoes.size,
        float(strengths.min(initial=np.inf)),
        float(strengths.max(initial=-np.inf)),
        float(echoes.min(initial=np.inf)),
    )


def strong_points(cloud: IntensityCloud, threshold: float) -> np.ndarray:
    """Return the numbers (m,) of the finite points above a threshold."""
    with np.errstate(invalid="ignore"):
        above = np.flatnonzero(np.ascontiguousarray(cloud.points[:, 3]) > np.float32(threshold))
    finite = np.isfinite(cloud.points.take(above, axis=0)).all(axis=1) & np.isfinite(cloud.time_stamps.take(above))
    return above if finite.all() else above[finite]


def _count_compiled(cloud: IntensityCloud) -> StrengthCounts:
    from sonar_processing.filters.compiled_strengths import count_strengths

    counts, ends = count_strengths(np.ascontiguousarray(cloud.points), np.ascontiguousarray(cloud.time_stamps))
    return StrengthCounts(counts[:-1], int(counts[-1]), *ends.tolist())


def _strong_compiled(cloud: IntensityCloud, threshold: float) -> np.ndarray:
    from sonar_processing.filters.compiled_strengths import strong_points

    points, stamps = np.ascontiguousarray(cloud.points), np.ascontiguousarray(cloud.time_stamps)
    return strong_points(points, stamps, np.float32(threshold))
