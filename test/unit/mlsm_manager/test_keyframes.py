"""A map drawn from keyframes is that of their last places, and free where they saw it from there."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_maps import random_points

from mlsm_manager.localisation.keyframe_map import KeyframeMap
from mlsm_manager.scan_matching.scan import MapCloud
from mlsm_manager.surface_map.free_space import Carver, CarvingParameters, FirstEchoes
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap

RESOLUTION, LIMIT, NEVER = 0.5, 1000.0, -np.inf
CARVER = Carver(CarvingParameters(crossings_least=5, crossings_per_point=1.0), np.radians(2.5))
ORIGIN = np.array([0.25, 0.25])


@dataclass(frozen=True)
class MovedBy:
    """Places clouds `shift` m along y."""

    shift: float

    def heard(self, cloud):
        origins = np.tile(ORIGIN + np.array([0.0, self.shift]), (len(cloud), 1))
        return cloud.points + np.array([0.0, self.shift, 0.0, 0.0]), origins


def patch(number):
    """Return keyframe `number`: a flat patch of points that ends at that second."""
    points = random_points(number, 40, extent=3.0) * [1.0, 1.0, 0.0, 1.0]
    return MapCloud(points, np.full(len(points), float(number)), float(number))


def made_at_once(*parts):
    made = MultiLevelSurfaceMap(RESOLUTION, LIMIT)
    for points in parts:
        made.insert(points)
    return made.blocks


def assert_same(found, wanted, within=1e-9):
    order, other = (np.lexsort(np.column_stack([b.cells, b.mean[:, 2]]).T) for b in (found, wanted))
    np.testing.assert_array_equal(found.cells[order], wanted.cells[other])
    np.testing.assert_allclose(found.rows[order], wanted.rows[other], atol=within)


STEP = st.tuples(st.sampled_from(["add", "draw", "insert"]), st.integers(-4, 4))


@given(st.lists(STEP, max_size=10), st.integers(-4, 4))
def test_it_equals_a_map_that_is_made_of_all_final_places(steps, last):
    shown, keyframes, inserted = KeyframeMap(RESOLUTION, LIMIT), [], []
    for number, (step, shift) in enumerate(steps):
        if step == "add":
            keyframes.append(patch(number))
            shown.add(keyframes[-1])
        elif step == "draw":
            shown.draw(MovedBy(0.3 * shift), NEVER)
        else:
            inserted.append(patch(number).points)
            shown.insert(inserted[-1])
    place = MovedBy(0.3 * last)
    shown.settle(place)
    assert_same(shown.map.blocks, made_at_once(*inserted, *(place.heard(keyframe)[0] for keyframe in keyframes)))
    assert shown.moving == []


AWAY = MovedBy(2.0)
PLACES = [patch(0).points, *(AWAY.heard(patch(number))[0] for number in (1, 2))]
"""Of keyframes 0 to 2, after the newer two were moved."""


@pytest.fixture
def three():
    """Return a map of keyframes 0 to 2, of which the oldest is settled."""
    shown = KeyframeMap(RESOLUTION, LIMIT)
    for number in range(3):
        shown.add(patch(number))
        shown.draw(MovedBy(0.0), settled_until=0.0)
    return shown


def test_a_settled_keyframe_stays_where_it_was_drawn(three):
    assert len(three.moving) == 2
    three.draw(AWAY, settled_until=0.0)
    assert_same(three.map.blocks, made_at_once(*PLACES))


def test_a_copy_ends_at_a_time_and_leaves_the_map_as_it_was(three):
    assert_same(three.drawn_until(1.0, AWAY).blocks, made_at_once(*PLACES[:2]))
    assert_same(three.map.blocks, made_at_once(*PLACES))


def test_what_is_settled_until_a_time_forgets_the_keyframes_after_it(three):
    three.settle(AWAY, 1.0)
    assert_same(three.map.blocks, made_at_once(*PLACES[:2]))
    assert not three.moving


def cloud(number, *echoes):
    """Return keyframe `number`, which ends at that second, with a beam for each of the echoes (x, y) [m]."""
    points = np.array([[x, y, -2.0, 50.0] for x, y in echoes]).reshape(-1, 4)
    return MapCloud(points, number + 0.001 * np.arange(len(points)), float(number))


def carved_map(*clouds, place=MovedBy(0.0), wall=None):
    """Return a map in which keyframes were drawn one after the other; wall: (m, 4), of points that were there."""
    made = KeyframeMap(RESOLUTION, LIMIT, carver=CARVER)
    if wall is not None:
        made.insert(wall)
    for keyframe in clouds:
        made.add(keyframe)
        made.draw(place, NEVER)
    return made


def cells(blocks):
    return sorted(map(tuple, blocks.cells.tolist()))


ECHO = st.tuples(st.integers(-8, 8).map(float), st.integers(-8, 8).map(lambda y: y + 0.3))


@given(st.lists(st.lists(ECHO, max_size=12), min_size=1, max_size=8), st.integers(-4, 4), st.integers(-4, 4))
def test_what_is_settled_is_as_if_every_keyframe_had_carved_once_from_its_last_place(frames, early, last):
    clouds = [cloud(number, *echoes) for number, echoes in enumerate(frames)]
    shown = carved_map(*clouds, place=MovedBy(0.7 * early))
    place = MovedBy(0.7 * last)
    shown.settle(place)
    occupied, free = MultiLevelSurfaceMap(RESOLUTION, LIMIT), MultiLevelSurfaceMap(RESOLUTION, LIMIT)
    for keyframe in clouds:
        points, origins = place.heard(keyframe)
        occupied.insert(points)
        beams = FirstEchoes.of_level(points, keyframe.times, origins)
        CARVER.carve(occupied, free, beams, points)
    assert cells(shown.map.blocks) == cells(occupied.blocks)
    assert cells(shown.free.blocks) == cells(free.blocks)
    assert sorted(shown.map.blocks.crossed) == sorted(occupied.blocks.crossed)
    assert sorted(shown.free.blocks.count) == sorted(free.blocks.count)


@pytest.mark.parametrize("looks", [True, False])
def test_many_keyframes_that_move_at_once_are_followed_a_few_with_each_scan(looks):
    """What nobody looked at in between is followed with the next look."""
    shown = carved_map(*(cloud(number, (10.25, 0.25)) for number in range(5)))
    assert {y for _, y in cells(shown.free.blocks)} <= {-1, 0, 1}
    shown.draw(MovedBy(5.0), NEVER)
    assert not looks or {y for _, y in cells(shown.free.blocks)} >= {0, 10}
    for _ in range(2):
        shown.draw(MovedBy(5.0), NEVER)
        assert not looks or len(shown.map)
    assert {y for _, y in cells(shown.free.blocks)} <= {9, 10, 11}


def crossed_wall(*places):
    """Return a map with a settled block at x = 5 m and keyframes with an echo at x [m] each along y = 0."""
    keyframes = [cloud(number, (x, 0.25)) for number, x in enumerate(places, 1)]
    return carved_map(*keyframes, wall=np.array([[5.25, 0.25, -2.0, 50.0]]))


BEHIND = 20.25


@pytest.mark.parametrize(
    ("places", "stays"), [([BEHIND] * 6, True), ([BEHIND] * 7, False), ([BEHIND] * 6 + [5.25] + [BEHIND] * 2, True)]
)
def test_a_block_goes_that_enough_moving_keyframes_look_through_and_none_hears(places, stays):
    assert ((10, 0) in cells(crossed_wall(*places).map.blocks)) == stays


def test_it_is_there_again_when_they_turn_out_to_have_looked_beside_it():
    shown = crossed_wall(*[BEHIND] * 7)
    for _ in range(4):
        shown.draw(MovedBy(5.0), NEVER)
    assert (10, 0) in cells(shown.map.blocks)


def test_it_is_gone_for_ever_when_they_are_settled():
    shown = crossed_wall(*[BEHIND] * 7)
    assert shown.draw(MovedBy(0.0), settled_until=np.inf).removed == 1
    assert cells(shown.map.blocks) == [(40, 0)]


def test_what_is_inserted_in_between_keeps_the_keyframes_in_the_map():
    shown = carved_map(cloud(1, (10.25, 0.25)))
    points = np.array([[0.25, 9.25, -2.0, 50.0]])
    shown.insert(points)
    shown.carve(points, np.array([2.0]), ORIGIN[np.newaxis])
    assert cells(shown.map.blocks) == [(0, 18), (20, 0)]
    assert {(0, 9), (9, 0)} <= set(cells(shown.free.blocks))


def test_nothing_is_carved_without_a_carver():
    shown = KeyframeMap(RESOLUTION, LIMIT)
    shown.add(cloud(1, (10.25, 0.25)))
    assert shown.draw(MovedBy(0.0), np.inf) is None
    assert len(shown.free.blocks) == 0
