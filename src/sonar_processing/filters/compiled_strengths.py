"""The loops of `strengths`, compiled; the results are the same to the last bit. Needs numba."""

import numpy as np
from numba import float32, float64, int64, njit, types

from sonar_processing.filters.otsu import EQUAL, HIGHEST_LEVEL

# Read-only is what arrays of messages are; others are taken too.
_POINTS = types.Array(float32, 2, "C", readonly=True)
_STAMPS = types.Array(float64, 1, "C", readonly=True)
_SILENT = HIGHEST_LEVEL + 1
_COUNTERS = 4
"""Neighbouring bins often have the same level, and a single counter would wait for its own last result."""
_ZERO, _HIGHEST = np.float32(0.0), np.float32(HIGHEST_LEVEL)
_GREATEST, _GREATEST_STAMP = np.finfo(np.float32).max, np.finfo(np.float64).max


@njit(cache=True)
def _is_finite(points, stamps, point):
    return (
        (abs(points[point, 0]) <= _GREATEST)
        & (abs(points[point, 1]) <= _GREATEST)
        & (abs(points[point, 2]) <= _GREATEST)
        & (abs(points[point, 3]) <= _GREATEST)
        & (abs(stamps[point]) <= _GREATEST_STAMP)
    )


@njit(types.Tuple((int64[::1], float32[::1]))(_POINTS, _STAMPS), cache=True)
def count_strengths(points, stamps):
    """Return how many finite points (n, 4) with stamps (n,) have each level, (257,), the last those of strength 0 or
    less; and the lowest and the highest strength, and the lowest above 0, (3,).
    """
    counts = np.zeros((_COUNTERS, _SILENT + 1), np.int64)
    lowest, highest, weakest = np.float32(np.inf), np.float32(-np.inf), np.float32(np.inf)
    for point in range(len(points)):
        if not _is_finite(points, stamps, point):
            continue
        strength = points[point, 3]
        level = _SILENT
        if strength > _ZERO:
            level = np.int64(min(strength, _HIGHEST))
            if strength < weakest:
                weakest = strength
        if strength < lowest:
            lowest = strength
        if strength > highest:
            highest = strength
        counts[point % _COUNTERS, level] += 1
    return counts.sum(axis=0), np.array([lowest, highest, weakest], np.float32)


@njit(int64[::1](_POINTS, _STAMPS, float32), cache=True)
def strong_points(points, stamps, threshold):
    """Return the numbers (m,) of the finite points (n, 4) with stamps (n,) that are stronger than `threshold`."""
    above, number, finite = np.empty(len(points), np.int64), 0, 0
    for point in range(len(points)):
        above[number] = point
        number += points[point, 3] > threshold
    for place in range(number):
        above[finite] = above[place]
        finite += _is_finite(points, stamps, above[place])
    return above[:finite].copy()


@njit(float64(int64[::1]), cache=True)
def threshold_of_levels(levels):
    """Return Otsu's threshold for levels (256,), not all 0; see `otsu.threshold_of_levels`."""
    number, total = 0, 0
    for level in range(len(levels)):
        number += levels[level]
        total += level * levels[level]
    between = np.full(len(levels), -1.0)
    below, sum_below = 0, 0
    for level in range(len(levels)):
        below += levels[level]
        sum_below += level * levels[level]
        above = number - below
        if below > 0 and above > 0:
            difference = sum_below / below - (total - sum_below) / above
            between[level] = np.float64(below * above) * (difference * difference)
    limit = between.max() * (1.0 - EQUAL)
    if limit < 0.0:
        return np.float64(np.flatnonzero(levels)[0])
    best = np.flatnonzero(between >= limit)
    return (best[0] + best[-1]) / 2.0
