"""Which beams make a scan."""

import math

import numpy as np
import pytest
from assemblers import assembler_with, placed
from clouds import SECOND

STEP = math.radians(3.0)


def _scan_ends(angles, **values):
    """Return after how many beams each scan came, for a head that passes through `angles`."""
    assembler = assembler_with(scan_size=3600, **values)
    return [count for count, angle in enumerate(angles, 1) if assembler.add(placed(angle=angle)) is not None]


def test_a_scan_ends_after_scan_size_beams():
    assembler = assembler_with(scan_size=3)
    assert [assembler.add(placed()) is not None for _ in range(7)] == [False, False, True, False, False, True, False]


def test_a_scan_size_of_one_gives_a_cloud_per_beam():
    assembler = assembler_with(scan_size=1)
    assert [len(assembler.add(placed())) for _ in range(3)] == [3, 3, 3]


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("start", [0.0, 0.5, math.pi, -math.pi, 100.0])
def test_a_scan_ends_before_the_head_passes_its_start_again(direction, start):
    assert _scan_ends(start + direction * STEP * np.arange(360)) == [120, 240, 360]


@pytest.mark.parametrize("direction", [1, -1])
def test_a_head_that_counts_from_minus_pi_to_pi_makes_no_difference(direction):
    angles = direction * STEP * np.arange(360)
    assert _scan_ends(np.arctan2(np.sin(angles), np.cos(angles))) == [120, 240, 360]


@pytest.mark.parametrize("missed", [1, 60, 118])
def test_a_missed_beam_does_not_lengthen_the_scan(missed):
    angles = np.delete(STEP * np.arange(240), missed)
    assert _scan_ends(angles) == [119, 239]


@pytest.mark.parametrize("lost", [[119], [118, 119], [100, 117, 118, 119]])
@pytest.mark.parametrize("direction", [1, -1])
def test_the_first_beam_of_a_turn_ends_the_one_before_whose_last_beams_were_lost(lost, direction):
    angles = np.delete(direction * STEP * np.arange(240), lost)
    assembler = assembler_with(scan_size=3600)
    scans = [assembler.add(placed(angle=angle, seconds=number)) for number, angle in enumerate(angles, 1)]
    lengths = [np.unique(scan.time_stamps).size for scan in scans if scan is not None]
    assert lengths == [120 - len(lost), 120]


def test_the_continuous_modes_go_on_over_the_end_of_a_turn():
    assembler = assembler_with(mode="LASERCONT", scan_size=3600)
    assert [len(assembler.add(placed(angle=count * STEP))) for count in range(250)][-1] == 250


def test_steps_that_vary_still_make_a_full_turn():
    steps = STEP * (1.0 + 0.1 * np.sin(np.arange(400)))
    lengths = np.diff([0, *_scan_ends(np.cumsum(steps))])
    assert len(lengths) == 3
    assert all(abs(length - 120) <= 2 for length in lengths)


def test_a_sector_that_swings_back_and_forth_never_makes_a_turn():
    swing = np.concatenate([np.arange(60), np.arange(60, 0, -1)] * 5) * STEP
    assert _scan_ends(swing) == []


def test_a_head_that_stands_still_never_makes_a_turn():
    assert _scan_ends(np.full(500, 1.0)) == []


def test_a_full_turn_can_be_told_not_to_end_a_scan():
    assert _scan_ends(STEP * np.arange(500), end_at_full_turn=False) == []


def test_a_servo_step_ends_the_scan_before_the_beam_that_saw_it():
    assembler = assembler_with()
    for seconds in (1, 2):
        assert assembler.add(placed(seconds=seconds, sensor_angle=0.1)) is None
    scan = assembler.add(placed(seconds=3, sensor_angle=0.2))
    assert np.unique(scan.time_stamps).tolist() == [-2.0, -1.0]
    assert scan.stamp_ns == 2 * SECOND


def test_the_beam_after_a_servo_step_begins_the_next_scan():
    assembler = assembler_with(scan_size=2)
    assembler.add(placed(seconds=1, sensor_angle=0.1))
    assembler.add(placed(seconds=2, sensor_angle=0.2))
    scan = assembler.add(placed(seconds=3, sensor_angle=0.2))
    assert np.unique(scan.time_stamps).tolist() == [-3.0, -2.0]


def test_a_servo_that_trembles_ends_nothing():
    assembler = assembler_with()
    assert [assembler.add(placed(sensor_angle=0.0005 * (count % 2))) for count in range(20)] == [None] * 20


@pytest.mark.parametrize(("mode", "per_beam"), [("SONARCONT", 3), ("LASERCONT", 1)])
def test_continuous_modes_give_the_newest_scan_size_beams_after_every_beam(mode, per_beam):
    assembler = assembler_with(mode=mode, scan_size=3)
    scans = [assembler.add(placed(seconds=seconds)) for seconds in range(1, 6)]
    beams = [np.unique(-scan.time_stamps).tolist() for scan in scans]
    assert beams == [[1], [1, 2], [1, 2, 3], [2, 3, 4], [3, 4, 5]]
    assert [len(scan) for scan in scans] == [per_beam * len(stamps) for stamps in beams]


def test_a_servo_step_empties_the_continuous_scan():
    assembler = assembler_with(mode="SONARCONT")
    assembler.add(placed(seconds=1, sensor_angle=0.1))
    assert set(assembler.add(placed(seconds=2, sensor_angle=0.2)).time_stamps) == {-2.0}


def test_clear_forgets_the_unfinished_scan():
    assembler = assembler_with(scan_size=2)
    assembler.add(placed(seconds=1))
    assembler.clear()
    assert assembler.add(placed(seconds=2)) is None
    assert set(assembler.add(placed(seconds=3)).time_stamps) == {-2.0, -3.0}


def test_clear_forgets_how_far_the_head_has_turned():
    assembler = assembler_with()
    for count in range(119):
        assembler.add(placed(angle=count * STEP))
    assembler.clear()
    assert assembler.add(placed(angle=119 * STEP)) is None
    assert assembler.add(placed(angle=120 * STEP)) is None


def test_clear_forgets_the_servo():
    assembler = assembler_with()
    assembler.add(placed(sensor_angle=0.1))
    assembler.clear()
    assert assembler.add(placed(sensor_angle=0.9)) is None


def test_an_unfinished_scan_before_a_silence_is_forgotten():
    assembler = assembler_with(scan_size=3)
    assembler.add(placed(seconds=1))
    later = [assembler.add(placed(seconds=seconds)) for seconds in (100, 101, 102)]
    assert later[:2] == [None, None]
    assert np.unique(np.abs(later[2].time_stamps)).tolist() == [100, 101, 102]
