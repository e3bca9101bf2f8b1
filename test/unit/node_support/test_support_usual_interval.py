"""What comes regularly is overdue after two of its intervals."""

import numpy as np
import pytest

from node_support.timing import UsualInterval


def taken(times):
    interval = UsualInterval()
    for time in times:
        interval.take(time)
    return interval


def test_after_two_intervals_it_is_overdue():
    interval = taken([100.0, 114.0, 128.0])
    assert interval.overdue(128.0 + 28.0) == 0.0
    assert interval.overdue(128.0 + 38.0) == pytest.approx(10.0)


def test_what_came_once_is_never_overdue():
    assert taken([]).overdue(1e6) == 0.0
    assert taken([3.0]).overdue(1e6) == 0.0


def test_one_long_pause_does_not_change_what_is_usual():
    interval = taken([0.0, 10.0, 20.0, 300.0, 310.0])
    assert interval.overdue(335.0) == pytest.approx(5.0)


def test_another_rhythm_is_learnt():
    interval = taken([*np.arange(0.0, 100.0, 10.0), *np.arange(100.0, 400.0, 40.0)])
    assert interval.overdue(380.0 + 80.0) == 0.0


def test_times_that_are_not_newer_say_nothing():
    interval = taken([0.0, 10.0, 20.0, 20.0, 5.0])
    assert interval.overdue(41.0) == pytest.approx(1.0)
