"""How long beams wait for tf."""

from typing import List

import numpy as np
import pytest
from virtual_line import VirtualTime

from sonar_processing.beams.beam import Beam
from sonar_processing.beams.beam_queue import NEWER_BEAMS, PATIENCE, BeamQueue


@pytest.fixture
def clock() -> VirtualTime:
    return VirtualTime()


@pytest.fixture
def queue(clock: VirtualTime) -> BeamQueue:
    return BeamQueue(clock.elapsed)


def beam(number: int, frame: str = "sonar") -> Beam:
    return Beam(number, frame, 0.0, np.ones(5, np.uint8), 1.0)


def fill(queue: BeamQueue, numbers: range, frame: str = "sonar") -> List[int]:
    """Add beams and return the numbers of those that had to go."""
    dropped = [queue.add(beam(number, frame), is_moving=False) for number in numbers]
    return [entry.beam.stamp_ns for entry in dropped if entry is not None]


def unknown(_: Beam) -> str:
    return "unknown to tf"


def popped(queue: BeamQueue, first: int, last: int) -> List[str]:
    """Pop while tf knows the beams from first to last; return number and obstacle of those that leave."""
    found = queue.pop(lambda one: "" if first <= one.stamp_ns <= last else "unknown")
    return [f"{waiting.beam.stamp_ns} {obstacle}".rstrip() for waiting, obstacle in found]


def test_beams_leave_in_order_as_soon_as_they_can_be_placed(queue: BeamQueue) -> None:
    fill(queue, range(5))
    assert popped(queue, 0, 2) == ["0", "1", "2"]
    assert popped(queue, 0, 9) == ["3", "4"]


def test_a_beam_leaves_with_its_obstacle_when_a_later_one_can_be_placed(queue: BeamQueue) -> None:
    fill(queue, range(3))
    assert popped(queue, 1, 1) == ["0 unknown", "1"]
    assert len(queue) == 1


def test_a_beam_does_not_leave_because_one_of_another_frame_can_be_placed(queue: BeamQueue) -> None:
    fill(queue, range(2), "left")
    fill(queue, range(2, 4), "right")
    assert popped(queue, 2, 3) == ["2", "3"]
    assert queue.frames() == {"left": 2}


def test_no_beam_is_lost_while_a_process_stands_still_for_two_seconds(queue: BeamQueue, clock: VirtualTime) -> None:
    fill(queue, range(NEWER_BEAMS))
    clock.now += 2.0
    assert fill(queue, range(NEWER_BEAMS, 5 * NEWER_BEAMS)) == []
    assert queue.pop(unknown) == []
    assert len(popped(queue, 0, 1000)) == 5 * NEWER_BEAMS


def test_what_cannot_be_placed_leaves_after_a_while_but_for_a_revolution(queue: BeamQueue, clock: VirtualTime) -> None:
    fill(queue, range(NEWER_BEAMS + 30))
    assert queue.pop(unknown) == []
    clock.now += PATIENCE + 0.1
    assert [obstacle for _, obstacle in queue.pop(unknown)] == ["unknown to tf"] * 30
    assert len(queue) == NEWER_BEAMS


def test_a_slow_head_may_wait_longer(queue: BeamQueue, clock: VirtualTime) -> None:
    for number in range(NEWER_BEAMS):
        fill(queue, range(number, number + 1))
        clock.now += 1.0
    assert queue.pop(unknown) == []


def test_beams_that_can_be_placed_wait_for_whoever_is_busy(queue: BeamQueue, clock: VirtualTime) -> None:
    fill(queue, range(NEWER_BEAMS))
    clock.now += 3.0 * PATIENCE
    assert fill(queue, range(NEWER_BEAMS, 2 * NEWER_BEAMS)) == []
    assert len(popped(queue, 0, 1000)) == 2 * NEWER_BEAMS


def test_a_flood_of_beams_takes_no_more_than_its_memory(queue: BeamQueue) -> None:
    dropped = fill(queue, range(100 * NEWER_BEAMS))
    assert dropped[:2] == [0, 1]
    assert len(queue) <= 10 * NEWER_BEAMS


def test_messages_of_many_beams_get_room_for_two(queue: BeamQueue, clock: VirtualTime) -> None:
    queue.make_room(1000)
    fill(queue, range(2000))
    clock.now += PATIENCE + 0.1
    assert queue.pop(unknown) == []


def test_cleared_beams_do_not_come_back(queue: BeamQueue) -> None:
    fill(queue, range(5))
    queue.clear()
    assert popped(queue, 0, 9) == []
