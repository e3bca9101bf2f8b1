import math

import numpy as np
import pytest

from sonar_processing.cloud import Cloud
from sonar_processing.shapes.echoes import (
    Sightings,
    beam_echoes,
    footprint,
    is_alone,
    is_oblique,
    is_scattered,
    sightings,
)

STEP = 0.05
NOTHING = Sightings(np.empty((0, 2)), np.empty((0, 2)), np.empty(0, int), np.empty(0, int), np.empty(0), STEP)


def _seen(ranges, weights=None, lengths=None):
    """Return echoes of neighbouring beams from the origin, 0.5 m apart at 10 m."""
    count = len(ranges)
    bearings = STEP * np.arange(count)
    points = np.column_stack([np.cos(bearings), np.sin(bearings)]) * np.asarray(ranges)[:, np.newaxis]
    weights = np.array(weights or [6] * count)
    lengths = 0.1 * (weights - 1) if lengths is None else np.array(lengths)
    return Sightings(points, np.zeros((count, 2)), np.arange(count), weights, lengths, STEP)


def _of(seen, *chosen):
    return seen.only(np.array(chosen))


def test_a_thing_far_from_all_echoes_is_alone():
    seen = _seen([10.0, 10.0, 14.0])
    assert is_alone(_of(seen, 0, 1), _of(seen, 2), NOTHING, clearance=0.7)


@pytest.mark.parametrize("clearance", [0.1, 1.0])
def test_an_echo_within_the_clearance_or_in_the_next_beam_is_company(clearance):
    seen = _seen([10.0, 10.0, 10.1])
    assert not is_alone(_of(seen, 0, 1), _of(seen, 2), NOTHING, clearance)


@pytest.mark.parametrize(("weight", "expected"), [(2, True), (3, False)])
def test_a_faint_echo_in_the_next_beam_is_company_where_it_is_half_as_strong(weight, expected):
    seen = _seen([10.0, 10.0, 10.1], weights=[6, 4, weight])
    assert is_alone(_of(seen, 0, 1), NOTHING, _of(seen, 2), clearance=0.7) == expected


@pytest.mark.parametrize(("farther", "expected"), [(0.0, False), (0.2, False), (0.5, True), (-0.5, True)])
def test_two_echoes_of_a_wall_met_at_more_than_35_degrees_are_oblique(farther, expected):
    assert is_oblique(_seen([10.0, 10.0 + farther])) == expected


def test_one_beam_that_meets_a_thing_twice_is_not_oblique():
    twice = _seen([10.0, 10.2])
    twice = Sightings(np.array([[10.0, 0.0], [10.2, 0.0]]), twice.origins, *_parts(twice))
    assert not is_oblique(twice)


def _parts(seen):
    return seen.beams, seen.weights, seen.lengths, seen.step


@pytest.mark.parametrize(("length", "expected"), [(0.3, False), (1.0, True)])
def test_echoes_with_holes_between_their_bins_are_scattered(length, expected):
    usual = _seen([10.0] * 9)
    assert is_scattered(_seen([10.0, 10.0], weights=[4, 4], lengths=[length, length]), usual) == expected


def test_echoes_of_one_point_each_are_never_scattered():
    single = _seen([10.0, 10.0], weights=[1, 1])
    assert not is_scattered(single, single)


def test_the_footprint_is_what_two_neighbouring_beams_cover():
    assert footprint(_seen([20.0, 20.0]), beam_width=0.04) == pytest.approx(20.0 * (STEP + 0.04))


def test_beams_that_heard_nothing_are_counted():
    bearings = math.radians(3.0) * np.array([0, 1, 2, 3, 9, 10])
    points = np.zeros((6, 4), dtype=np.float32)
    points[:, 0], points[:, 1], points[:, 3] = np.cos(bearings) * 10.0, np.sin(bearings) * 10.0, 100.0
    stamps = 100.0 + 0.133 * np.array([0, 1, 2, 3, 9, 10])
    echoes = beam_echoes(Cloud(points, stamps, 10**9, "odom"), gap=0.5)
    seen = sightings(echoes, np.arange(6), np.zeros((6, 2)))
    assert seen.beams.tolist() == [0, 1, 2, 3, 9, 10]
    assert seen.step == pytest.approx(math.radians(3.0), abs=1e-6)
