import pytest

from node_support.timing import Pace


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
    assert pace.wait_for(10.0) == 0.0
    assert clock.now == pytest.approx(100.0 + 10.0 / factor)


def test_a_small_delay_is_caught_up(clock):
    pace = _pace(clock, 1.0)
    clock.now += 0.3
    assert pace.wait_for(0.1) == pytest.approx(0.2)
    pace.wait_for(1.0)
    assert clock.now == pytest.approx(101.0)
    assert pace.lost == 0.0


def test_after_a_long_delay_time_does_not_race(clock):
    pace = _pace(clock, 1.0)
    clock.now += 60.0
    pace.wait_for(1.0)
    pace.wait_for(2.0)
    assert clock.now == pytest.approx(161.0)
    assert pace.lost == pytest.approx(59.0)
