"""Otsu's threshold against the thesis's procedure (6.5.3), step by step and in exact fractions."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from node_support.errors import RefusedInput
from sonar_processing.filters.threshold import otsu_threshold

LEVELS = st.lists(st.integers(0, 255), min_size=1, max_size=60)
FEW_LEVELS = st.lists(st.sampled_from([0, 1, 2, 100, 101, 200, 255]), min_size=1, max_size=60)


def literal_threshold(levels):
    """Return the threshold by stepping through all levels; the only level when there is nothing to separate."""
    histogram = [levels.count(level) for level in range(256)]
    total = len(levels)
    first = last = greatest = None
    for t in range(256):
        n1, n2 = sum(histogram[: t + 1]), sum(histogram[t + 1 :])
        if not n1 or not n2:
            continue
        mu1 = Fraction(sum(level * histogram[level] for level in range(t + 1)), n1)
        mu2 = Fraction(sum(level * histogram[level] for level in range(t + 1, 256)), n2)
        between = Fraction(n1, total) * Fraction(n2, total) * (mu1 - mu2) ** 2
        if greatest is None or between > greatest:
            first, greatest = t, between
        if between >= greatest:
            last = t
    return float(levels[0]) if greatest is None else (first + last) / 2.0


@pytest.mark.parametrize("strategy", [LEVELS, FEW_LEVELS], ids=["many levels", "few levels"])
@given(st.data())
def test_it_is_the_mean_of_the_first_and_the_last_maximum(strategy, data):
    levels = data.draw(strategy)
    assert otsu_threshold(np.array(levels)) == literal_threshold(levels)


@given(LEVELS, st.integers(2, 1000))
def test_copies_of_a_scan_have_its_threshold(levels, copies):
    assert otsu_threshold(np.repeat(levels, copies)) == literal_threshold(levels)


def test_it_lies_midway_between_two_levels():
    assert otsu_threshold(np.array([10, 10, 20])) == 14.5


def test_symmetric_levels_have_two_maxima_that_are_averaged():
    assert otsu_threshold(np.array([0, 50, 100])) == 49.5


def test_strengths_above_127_are_levels_of_their_own():
    assert otsu_threshold(np.array([128, 255])) == literal_threshold([128, 255]) == 191.0


def test_strengths_outside_the_levels_count_in_the_nearest():
    assert otsu_threshold(np.array([-50.0, 1000.0])) == literal_threshold([0, 255])


def test_fractions_of_a_level_count_in_the_level_below():
    assert otsu_threshold(np.array([10.9, 20.2])) == literal_threshold([10, 20])


@pytest.mark.parametrize("level", [0, 30, 200, 255])
def test_one_level_is_its_own_threshold(level):
    assert otsu_threshold(np.full(5, level)) == level


@pytest.mark.parametrize("dtype", [np.uint8, np.float32, np.float64, np.int64])
def test_the_type_of_the_strengths_does_not_matter(dtype):
    assert otsu_threshold(np.array([3, 4, 90, 95], dtype=dtype)) == literal_threshold([3, 4, 90, 95])


def test_a_large_scan_does_not_overflow():
    levels = np.concatenate([np.full(3_000_000, 250), np.full(2_000_000, 255)])
    assert otsu_threshold(levels) == literal_threshold([250, 250, 250, 255, 255])


def test_no_strengths_are_refused():
    with pytest.raises(RefusedInput) as refused:
        otsu_threshold(np.empty(0))
    assert refused.value.kind == "clouds without points"
