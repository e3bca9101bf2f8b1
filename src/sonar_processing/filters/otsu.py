"""Otsu's threshold as the thesis computes it (6.5.3, equations 6.1 to 6.4)."""

import numpy as np

from node_support.errors import RefusedInput

HIGHEST_LEVEL = 255
EQUAL = 1e-12  # Share by which between-class variances differ because of rounding
_LEVELS = np.arange(HIGHEST_LEVEL + 1)


def otsu_threshold(strengths: np.ndarray) -> float:
    """Return the strength that separates echoes from background best; echoes are the points above it.

    strengths: (n,) any numeric type; they are counted in integer levels 0 to 255, what lies outside in the nearest.
    The result is the mean of the first and the last level that maximise the between-class variance; with one
    level only there is nothing to separate and that level is returned. Raises RefusedInput when `strengths` is empty.
    """
    if strengths.size == 0:
        raise RefusedInput("clouds without points", "no strength to take a threshold of")
    return threshold_of_levels(level_histogram(strengths))


def threshold_of_levels(histogram: np.ndarray) -> float:
    """Return Otsu's threshold as otsu_threshold does, for the number of points in each level (256,), not all 0."""
    count_below = histogram.cumsum()
    lowest, highest = count_below.searchsorted([1, count_below[-1]])
    if lowest == highest:
        return float(lowest)
    separating = slice(lowest, highest)
    sum_below = (histogram * _LEVELS).cumsum()
    w1, sum1 = count_below[separating], sum_below[separating]
    w2, sum2 = count_below[-1] - w1, sum_below[-1] - sum1
    between = w1 * w2 * (sum1 / w1 - sum2 / w2) ** 2
    best = np.flatnonzero(between >= between.max() * (1.0 - EQUAL)) + lowest
    return float(best[0] + best[-1]) / 2.0


def level_histogram(strengths: np.ndarray) -> np.ndarray:
    """Return (256,) int64: how many of `strengths` (n,), any numeric type, n > 0, lie in each integer level."""
    strengths = np.ascontiguousarray(strengths)
    if not (strengths.min() >= 0 and strengths.max() < HIGHEST_LEVEL + 1):
        strengths = np.clip(strengths, 0, HIGHEST_LEVEL)
    # By way of the smallest type, because float to int64 takes twice as long as both steps.
    levels = strengths.astype(np.uint8).astype(np.intp)
    return np.bincount(levels, minlength=HIGHEST_LEVEL + 1)
