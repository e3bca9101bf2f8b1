"""Time in step with the wall clock, and what is overdue."""

import pytest

from node_support.timing import Pace, UsualInterval


class Clock:
    """A wall clock that only waiting moves on."""

    def __init__(self):
        self.now = 100.0

    def wait(self, seconds):
        self.now += seconds


@pytest.fixture
def clock():
    return Clock()


def _pace(clock, factor):
    return Pace(factor, clock.wait, lambda: clock.now)


@pytest.mark.parametrize("factor", [0.5, 1.0, 20.0])
def test_simulated_time_passes_factor_times_as_fast(clock, factor):
    pace = _pace(clock, factor)
    assert not pace.wait_for(10.0)
    assert clock.now == pytest.approx(100.0 + 10.0 / factor)


def test_a_small_delay_is_caught_up(clock):
    pace = _pace(clock, 1.0)
    clock.now += 0.3
    assert not pace.wait_for(0.1)
    pace.wait_for(1.0)
    assert clock.now == pytest.approx(101.0)
    assert pace.lost == 0.0


def test_after_a_long_delay_time_does_not_race(clock):
    pace = _pace(clock, 1.0)
    clock.now += 60.0
    assert pace.wait_for(1.0)
    pace.wait_for(2.0)
    assert clock.now == pytest.approx(161.0)
    assert pace.lost == pytest.approx(59.0)


@pytest.mark.parametrize(
    ("times", "now", "overdue"),
    [
        # After two intervals.
        ([100.0, 114.0, 128.0], 128.0 + 28.0, 0.0),
        ([100.0, 114.0, 128.0], 128.0 + 38.0, 10.0),
        # What came once, or never.
        ([], 1e6, 0.0),
        ([3.0], 1e6, 0.0),
        # One long pause does not change what is usual, another rhythm does.
        ([0.0, 10.0, 20.0, 300.0, 310.0], 335.0, 5.0),
        ([*range(0, 100, 10), *range(100, 400, 40)], 380.0 + 80.0, 0.0),
        # Times that are not newer say nothing.
        ([0.0, 10.0, 20.0, 20.0, 5.0], 41.0, 1.0),
    ],
)
def test_what_comes_regularly_is_overdue_after_two_intervals(times, now, overdue):
    interval = UsualInterval()
    for time in times:
        interval.take(time)
    assert interval.overdue(now) == pytest.approx(overdue)
