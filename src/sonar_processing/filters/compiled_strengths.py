"""The loops of the threshold over all points of a cloud, compiled: more than twice as fast as numpy."""

import numpy as np
from numba import float32, float64, int64, types

from node_support.numba_cache import compiled
from sonar_processing.cloud import HIGHEST_STRENGTH

# Read-only is what arrays of messages are; others are taken too.
_POINTS = types.Array(float32, 2, "C", readonly=True)
_STAMPS = types.Array(float64, 1, "C", readonly=True)
_SILENT = HIGHEST_STRENGTH + 1
_EQUAL = 1e-12  # Share by which between-class variances differ because of rounding
_COUNTERS = 4
"""Neighbouring bins often have the same level, and a single counter would wait for its own last result."""
_ZERO, _HIGHEST, _INFINITE = np.float32(0.0), np.float32(HIGHEST_STRENGTH), np.float32(np.inf)
_EXPONENT, _LONG_EXPONENT = np.int32(0x7F800000), np.int64(0x7FF0000000000000)
_GREATEST, _GREATEST_STAMP = np.finfo(np.float32).max, np.finfo(np.float64).max


@compiled()
def _is_finite(points, stamps, point):
    return (
        (abs(points[point, 0]) <= _GREATEST)
        & (abs(points[point, 1]) <= _GREATEST)
        & (abs(points[point, 2]) <= _GREATEST)
        & (abs(points[point, 3]) <= _GREATEST)
        & (abs(stamps[point]) <= _GREATEST_STAMP)
    )


@compiled()
def _are_all_finite(points, stamps):
    """Return whether no bits of an exponent are all set: without a branch many values are looked at together."""
    words, long_words = points.reshape(-1).view(np.int32), stamps.view(np.int64)
    broken, long_broken = np.int32(0), np.int64(0)
    for place in range(len(words)):
        broken |= (words[place] & _EXPONENT) == _EXPONENT
    for place in range(len(long_words)):
        long_broken |= (long_words[place] & _LONG_EXPONENT) == _LONG_EXPONENT
    return (broken == 0) & (long_broken == 0)


@compiled(types.Tuple((int64[::1], float32[::1]))(_POINTS, _STAMPS))
def count_strengths(points, stamps):
    """Return how many finite points (n, 4) with stamps (n,) have each level, (257,), the last those of strength 0 or
    less; and the lowest and the highest strength, and the lowest above 0, (3,).
    """
    counts, are_finite = np.zeros((_COUNTERS, _SILENT + 1), np.int64), _are_all_finite(points, stamps)
    lowest, highest, weakest = _INFINITE, -_INFINITE, _INFINITE
    for point in range(len(points)):
        if not are_finite and not _is_finite(points, stamps, point):
            continue
        strength = points[point, 3]
        is_silent = strength <= _ZERO
        level = _SILENT if is_silent else np.int64(min(strength, _HIGHEST))
        echo = _INFINITE if is_silent else strength
        weakest = echo if echo < weakest else weakest
        lowest = strength if strength < lowest else lowest
        highest = strength if strength > highest else highest
        counts[point % _COUNTERS, level] += 1
    for counter in range(1, _COUNTERS):
        for level in range(_SILENT + 1):
            counts[0, level] += counts[counter, level]
    return counts[0], np.array([lowest, highest, weakest], np.float32)


@compiled(int64[::1](_POINTS, _STAMPS, float32))
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


@compiled(float64(int64[::1]))
def threshold_of_levels(levels):
    """Return Otsu's threshold for the number of points in each level (256,), not all 0; see `otsu_threshold`."""
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
    limit = between.max() * (1.0 - _EQUAL)
    if limit < 0.0:
        return np.float64(np.flatnonzero(levels)[0])
    best = np.flatnonzero(between >= limit)
    return (best[0] + best[-1]) / 2.0
