import pytest

from imagenex_852_driver.emulated_852 import HeadRotation
from imagenex_852_driver.protocol.command import SwitchCommand


def positions(command, count, motion=None):
    motion = motion or HeadRotation()
    found = []
    for _ in range(count):
        motion.obey(command)
        found.append((motion.position - 1400) * 0.15)
        motion.step(command)
    return pytest.approx(found)


def test_a_full_turn_goes_round_clockwise():
    command = SwitchCommand(max_range=20, step_size_deg=6)
    expected = [*range(0, 180, 6), *range(-180, 0, 6), 0, 6]
    assert positions(command, 62) == expected


def test_reverse_goes_round_counter_clockwise():
    assert positions(SwitchCommand(max_range=20, reverse=True), 3) == [0, -3, -6]


def test_a_sector_is_scanned_to_and_fro():
    command = SwitchCommand(max_range=20, sector_width_deg=12)
    assert positions(command, 9) == [0, 3, 6, 3, 0, -3, -6, -3, 0]


def test_a_head_outside_of_its_sector_steps_towards_it_and_then_scans_it():
    command = SwitchCommand(max_range=20, train_angle_deg=12, sector_width_deg=6)
    assert positions(command, 8) == [0, 3, 6, 9, 12, 15, 12, 9]


def test_reverse_turns_a_sector_scan_around_at_once():
    motion = HeadRotation()
    positions(SwitchCommand(max_range=20, sector_width_deg=60), 2, motion)
    reverse = SwitchCommand(max_range=20, sector_width_deg=60, reverse=True)
    assert positions(reverse, 3, motion) == [6, 3, 0]


def test_without_a_step_the_head_stays():
    assert positions(SwitchCommand(max_range=20, step_size_deg=0), 3) == [0, 0, 0]


def test_a_sector_of_no_width_is_a_fixed_beam_at_the_train_angle():
    command = SwitchCommand(max_range=20, train_angle_deg=-6, sector_width_deg=0)
    assert positions(command, 5) == [0, -3, -6, -6, -6]
