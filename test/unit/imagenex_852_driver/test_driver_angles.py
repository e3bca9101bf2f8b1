import math

import pytest

from imagenex_852_driver.protocol.reply import head_angle, head_position


def test_straight_ahead_is_zero():
    assert head_angle(1400) == 0.0


def test_the_head_counts_clockwise_and_the_angle_counter_clockwise():
    assert head_angle(1400 + 600) == pytest.approx(-math.pi / 2)


def test_a_head_upside_down_turns_the_other_way():
    assert head_angle(1400 + 600, inverted=True) == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("position", range(0, 2801, 20))
def test_angles_stay_within_half_a_turn(position):
    assert abs(head_angle(position)) <= math.pi


def test_positions_a_turn_apart_have_one_angle():
    assert head_angle(2800) == pytest.approx(head_angle(2800 - 2400))


@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize("position", range(201, 2600, 7))
def test_positions_come_back_from_their_angles(position, inverted):
    assert head_position(head_angle(position, inverted), inverted) == position
