"""When scan and map are of one place: what counts against it, and what says nothing."""

import numpy as np
import pytest
from made_scans import harbour, wall

from mlsm_manager.scan_matching.judgement import agreement

HERE = np.zeros(2)


def agreed(points, on_map, blocks):
    return agreement(points, np.broadcast_to(on_map, len(points)), HERE, blocks)


def test_a_scan_of_the_mapped_place_agrees_wholly():
    assert agreed(harbour(0.2), True, harbour()) == pytest.approx(1.0)


def test_echoes_beside_what_the_map_has_in_their_direction_count_against_it():
    mapped, boat = wall((-20, 10), (20, 10)), wall((-8, 6), (8, 6))
    points = np.vstack([mapped, boat])
    assert agreed(points, np.arange(len(points)) < len(mapped), mapped) == pytest.approx(len(mapped) / len(points))


def test_echoes_in_a_direction_in_which_the_map_has_nothing_yet_say_nothing():
    mapped, unknown = wall((-20, 10), (20, 10)), wall((-20, -10), (20, -10))
    points = np.vstack([mapped, unknown])
    assert agreed(points, np.arange(len(points)) < len(mapped), mapped) == pytest.approx(1.0)


def test_a_mapped_surface_counts_against_it_when_echoes_come_from_behind():
    behind, before = wall((-20, 12), (20, 12)), wall((-4, 6), (4, 6))
    assert agreed(behind, True, np.vstack([behind, before])) < 0.85


def test_a_mapped_surface_behind_a_nearer_echo_says_nothing():
    near, hidden = wall((-20, 6), (20, 6)), wall((-8, 12), (8, 12))
    assert agreed(near, True, np.vstack([near, hidden])) == pytest.approx(1.0)


def test_a_mapped_surface_in_a_direction_without_any_echo_says_nothing():
    heard, silent = wall((-20, 10), (20, 10)), wall((-5, -10), (5, -10))
    assert agreed(heard, True, np.vstack([heard, silent])) == pytest.approx(1.0)
