"""Otsu's threshold as the thesis computes it (6.5.3, equations 6.1 to 6.4)."""

import numpy as np

from node_support.errors import RefusedInput

HIGHEST_LEVEL = 255


def otsu_threshold(strengths: np.ndarray) -> float:
    """Return the strength that separates echoes from background best; echoes are the points above it.

    strengths: (n,) any numeric type; they are counted in integer levels 0 to 255, what lies outside in the nearest.
    The result is the mean of the first and the last level that maximise the between-class variance; with one
    level only there is nothing to separate and that level is returned. Raises RefusedInput when `strengths` is empty.
    """
    if strengths.size == 0:
        raise RefusedInput("clouds without points", "no strength to take a threshold of")
    levels = np.clip(strengths, 0, HIGHEST_LEVEL).astype(np.int64)
    histogram = np.bincount(levels, minlength=HIGHEST_LEVEL + 1)
    level = np.arange(histogram.size)
    count_below = np.cumsum(histogram)
    sum_below = np.cumsum(histogram * level)
    count_above = count_below[-1] - count_below
    sum_above = sum_below[-1] - sum_below
    separates = (count_below > 0) & (count_above > 0)
    if not separates.any():
        return float(levels[0])
    w1, w2 = count_below[separates], count_above[separates]
    between = w1 * w2 * (sum_below[separates] / w1 - sum_above[separates] / w2) ** 2
    best = level[separates][between >= between.max() * (1.0 - 1e-12)]
    return float(best[0] + best[-1]) / 2.0
