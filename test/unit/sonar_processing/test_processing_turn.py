"""When a turn of the head is over, and which beams it holds."""

import math

import numpy as np
import pytest
from clouds import placed
from hypothesis import given
from hypothesis import strategies as st

from sonar_processing.beams.head import HeadTurn
from sonar_processing.scans.assembler import MOST_BEAMS, RevolutionCollector

STEP = math.radians(3.0)


def _turns(beams):
    """Return the `seconds` of the beams of every turn; beams are dictionaries for `beam_of`, ten in a second."""
    collector = RevolutionCollector()
    turns = [collector.add(placed(**{**beam, "seconds": beam.get("seconds", 1) / 10})) for beam in beams]
    return [[round(one.beam.stamp_ns * 1e-8) for one in turn] for turn in turns if turn is not None]


def _lengths(angles):
    return [len(turn) for turn in _turns([{"angle": angle} for angle in angles])]


@pytest.mark.parametrize("direction", [1, -1])
def test_a_turn_holds_every_direction_once(direction):
    assert _lengths(direction * STEP * np.arange(360)) == [120, 120, 120]


@given(st.sets(st.integers(0, 239), max_size=60), st.sampled_from([1, -1]), st.floats(0.0, 6.0))
def test_lost_beams_leave_turns_where_they_are(lost, direction, start):
    kept = [number for number in range(360) if number not in lost]
    turns = _turns([{"angle": start + direction * STEP * number, "seconds": number} for number in kept])
    begin = min(kept)
    assert all(turn[-1] - turn[0] < 120 for turn in turns)
    assert turns[0] == [number for number in kept if number < begin + 120]


def test_a_sector_gives_a_sweep_for_every_swing():
    swing = np.concatenate([np.arange(0, 30), np.arange(28, 0, -1)])
    assert _lengths(STEP * np.tile(swing, 3)) == [30, 29, 29, 29, 29]


def test_a_head_that_trembles_does_not_go_back():
    angles = STEP * np.arange(120)
    angles[50] -= 1.2 * STEP
    assert _lengths(angles) == [120]


def test_a_head_that_stands_still_gives_nothing_and_holds_only_the_newest():
    collector = RevolutionCollector()
    assert [collector.add(placed(angle=1.0)) for _ in range(MOST_BEAMS + 10)] == [None] * (MOST_BEAMS + 10)
    assert len(collector) == MOST_BEAMS


@pytest.mark.parametrize("change", [{"sensor_angle": 0.2}, {"strengths": (1, 2)}, {"resolution": 0.5}])
def test_a_turn_in_which_the_servo_or_the_range_changed_is_forgotten(change):
    beams = [{"angle": STEP * number, "seconds": number, **(change if number >= 50 else {})} for number in range(200)]
    assert _turns(beams) == [list(range(50, 170))]


def test_clear_forgets_the_beams():
    collector = RevolutionCollector()
    collector.add(placed())
    collector.clear()
    assert len(collector) == 0


def test_the_usual_step_is_not_that_of_the_gaps():
    turn = HeadTurn()
    for number in [0, 1, 2, 5, 6, 7, 8, 20]:
        turn.add(number * STEP)
    assert turn.usual_step == pytest.approx(STEP)


def test_a_change_of_the_step_within_a_turn_costs_no_turn_after_it():
    angles = np.concatenate([np.arange(0, 540, 3), np.arange(540, 1800, 6)])
    assert _lengths(np.radians(angles)) == [120, 90, 60, 60, 60]


def test_a_sector_after_whole_turns_gives_its_sweeps():
    swing = np.concatenate([np.arange(60, 120), np.arange(118, 60, -1)])
    lengths = _lengths(STEP * np.concatenate([np.arange(240), np.tile(swing / 2.0, 3)]))
    assert lengths[:2] == [120, 120]
    assert lengths[-3:] == [59, 59, 59]


def test_beams_before_and_after_a_silence_make_no_turn_together():
    before = [{"angle": STEP * number, "seconds": number} for number in range(50)]
    after = [{"angle": STEP * number, "seconds": 1000 + number} for number in range(50, 180)]
    assert _turns(before + after) == [list(range(1050, 1170))]
