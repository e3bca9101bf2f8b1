"""Lost beams and changes of a head's settings while it runs are noticed."""

import math
from collections import Counter

import pytest
from clouds import beam_of
from hypothesis import given
from hypothesis import strategies as st

from sonar_processing.beams.head import HeadEvent, HeadWatch

GRADIAN = math.pi / 200.0


def events_of(steps, bins=None):
    """Return all events of beams at these numbers of gradians."""
    watch, found = HeadWatch(), Counter()
    for number, step in enumerate(steps):
        strengths = (1,) * (3 if bins is None else bins[number])
        found += watch.add(beam_of(strengths, step * GRADIAN))
    return found


def sweeps(first, last, count, step=2):
    one = list(range(first, last + 1, step))
    return [angle for number in range(count) for angle in (one if number % 2 == 0 else one[::-1])]


@given(st.integers(0, 399), st.sampled_from([-8, -2, -1, 1, 2, 8]))
def test_a_head_that_turns_round_and_round_is_unremarkable(first, step):
    assert events_of(range(first, first + 1000 * step, step)) == Counter()


@pytest.mark.parametrize("sector", [(-60, 60, 8), (0, 400, 6)])
def test_a_head_that_sweeps_a_sector_or_a_whole_turn_is_unremarkable(sector):
    assert events_of(sweeps(*sector)) == Counter()


@given(st.sets(st.integers(2, 190), min_size=1, max_size=20))
def test_lost_beams_are_counted(lost):
    """But where so many are lost in a row that the head's step seems to be another."""
    steps = [2 * number for number in range(200) if number not in lost]
    gaps = Counter(b - a for a, b in zip(steps, steps[1:]) if b - a > 2)
    if max(gaps.values(), default=0) < 3 and max(gaps, default=0) * GRADIAN < 0.4:
        assert events_of(steps) == Counter({HeadEvent.LOST: len(lost)})


def test_a_change_of_sector_is_noticed():
    found = events_of([*sweeps(-60, 60, 6), *sweeps(-20, 20, 6)])
    assert found[HeadEvent.SECTOR_CHANGED] >= 1
    assert found[HeadEvent.LOST] == 0


def test_a_sector_after_whole_turns_and_whole_turns_after_a_sector_are_noticed():
    assert events_of([*range(0, 900, 2), *range(898, 800, -2)])[HeadEvent.SECTOR_CHANGED] == 1
    assert events_of([*sweeps(-60, 60, 4), *range(-60, 800, 2)])[HeadEvent.SECTOR_CHANGED] >= 1


def test_a_change_of_step_or_range_is_noticed_and_no_loss_of_beams():
    assert events_of([*range(100), *range(100, 300, 3)]) == Counter({HeadEvent.STEP_CHANGED: 1})
    assert events_of(range(6), bins=[3, 3, 5, 5, 3, 3]) == Counter({HeadEvent.RANGE_CHANGED: 2})
