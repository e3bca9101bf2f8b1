"""How long beams wait for tf."""

from types import SimpleNamespace

import numpy as np
import pytest

from sonar_processing.beams.beam import Beam
from sonar_processing.beams.beam_queue import NEWER_BEAMS, PATIENCE, BeamQueue

NONE = range(0)


@pytest.fixture
def clock():
    return SimpleNamespace(now=0.0)


@pytest.fixture
def queue(clock):
    return BeamQueue(lambda: clock.now)


def fill(queue, numbers, frame="sonar"):
    """Add beams and return the numbers of those that had to go."""
    beams = [Beam(number, frame, 0.0, np.ones(5, np.uint8), 1.0) for number in numbers]
    dropped = [queue.add(beam, is_moving=False) for beam in beams]
    return [entry.beam.stamp_ns for entry in dropped if entry is not None]


def popped(queue, known):
    """Pop while tf knows the beams of these numbers; return number and obstacle of those that leave."""
    found = queue.pop(lambda one: "" if one.stamp_ns in known else "unknown")
    return [f"{waiting.beam.stamp_ns} {obstacle}".rstrip() for waiting, obstacle in found]


def test_beams_leave_in_order_as_soon_as_they_can_be_placed(queue):
    fill(queue, range(5))
    assert popped(queue, range(3)) == ["0", "1", "2"]
    assert popped(queue, range(9)) == ["3", "4"]


def test_a_beam_leaves_with_its_obstacle_when_a_later_one_can_be_placed(queue):
    fill(queue, range(3))
    assert popped(queue, [1]) == ["0 unknown", "1"]
    assert len(queue) == 1


def test_a_beam_does_not_leave_because_one_of_another_frame_can_be_placed(queue):
    fill(queue, range(2), "left")
    fill(queue, range(2, 4), "right")
    assert popped(queue, [2, 3]) == ["2", "3"]
    assert queue.frames() == {"left": 2}


@pytest.mark.parametrize(("seconds", "scans"), [(2.0, 5), (3.0 * PATIENCE, 2)])
def test_no_beam_is_lost_while_a_process_stands_still_or_is_busy(queue, clock, seconds, scans):
    fill(queue, range(NEWER_BEAMS))
    clock.now += seconds
    assert fill(queue, range(NEWER_BEAMS, scans * NEWER_BEAMS)) == []
    assert len(popped(queue, range(1000))) == scans * NEWER_BEAMS


def test_what_cannot_be_placed_leaves_after_a_while_but_for_a_revolution(queue, clock):
    fill(queue, range(NEWER_BEAMS + 30))
    clock.now += PATIENCE - 0.1
    assert popped(queue, NONE) == []
    clock.now += 0.2
    assert popped(queue, NONE) == [f"{number} unknown" for number in range(30)]
    assert len(queue) == NEWER_BEAMS


def test_a_slow_head_may_wait_longer(queue, clock):
    for number in range(NEWER_BEAMS):
        fill(queue, [number])
        clock.now += 1.0
    assert popped(queue, NONE) == []


def test_a_flood_of_beams_takes_no_more_than_its_memory(queue):
    dropped = fill(queue, range(100 * NEWER_BEAMS))
    assert dropped[:2] == [0, 1]
    assert len(queue) <= 10 * NEWER_BEAMS


def test_messages_of_many_beams_get_room_for_two(queue, clock):
    queue.make_room(1000)
    fill(queue, range(2000))
    clock.now += PATIENCE + 0.1
    assert popped(queue, NONE) == []


def test_cleared_beams_do_not_come_back(queue):
    fill(queue, range(5))
    queue.clear()
    assert popped(queue, range(9)) == []
