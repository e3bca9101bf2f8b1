"""Time in step with the wall clock, and what is overdue."""

from types import SimpleNamespace

import pytest

from node_support.timing import Pace, UsualInterval


@pytest.mark.parametrize(
    ("factor", "delay", "waits", "end", "is_late", "lost"),
    [
        *((factor, 0.0, [10.0], 10.0 / factor, False, 0.0) for factor in (0.5, 1.0, 20.0)),
        (1.0, 0.3, [0.1, 1.0], 1.0, False, 0.0),
        (1.0, 60.0, [1.0, 2.0], 61.0, True, 59.0),
    ],
)
def test_simulated_time_catches_up_with_a_small_delay_and_does_not_race_after_a_long_one(
    factor, delay, waits, end, is_late, lost
):
    clock = SimpleNamespace(now=100.0)

    def wait(seconds):
        clock.now += seconds

    pace = Pace(factor, wait, lambda: clock.now)
    clock.now += delay
    assert [pace.wait_for(simulated) for simulated in waits] == [is_late, False][: len(waits)]
    assert (clock.now, pace.lost) == (pytest.approx(100.0 + end), pytest.approx(lost))


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
