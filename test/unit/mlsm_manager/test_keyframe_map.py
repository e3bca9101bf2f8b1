"""A map drawn from keyframes is that of their last places."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_maps import random_points

from mlsm_manager.localisation.clouds import Cloud
from mlsm_manager.localisation.keyframe_map import KeyframeMap
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap

RESOLUTION, LIMIT = 0.5, 1000.0


def cloud(number):
    """Return keyframe `number`: a flat patch of points that ends at that second."""
    points = random_points(number, 40, extent=3.0) * [1.0, 1.0, 0.0, 1.0]
    return Cloud(points, np.full(len(points), float(number)), float(number))


@dataclass(frozen=True)
class MovedBy:
    """Places clouds `shift` m along x, heard from a sonar that was at x = y = 0 in odom."""

    shift: float

    def points(self, cloud):
        return cloud.points + np.array([self.shift, 0.0, 0.0, 0.0])

    def origins(self, cloud):
        return np.tile([self.shift, 0.0], (len(cloud), 1))


def made_at_once(*parts):
    made = MultiLevelSurfaceMap(RESOLUTION, LIMIT)
    for points in parts:
        made.insert(points)
    return made.blocks


def assert_same(found, wanted):
    order, other = (np.lexsort(np.column_stack([b.cells, b.mean[:, 2]]).T) for b in (found, wanted))
    np.testing.assert_array_equal(found.cells[order], wanted.cells[other])
    np.testing.assert_allclose(found.mean[order], wanted.mean[other], atol=1e-9)


STEP = st.tuples(st.sampled_from(["add", "draw", "insert"]), st.integers(-4, 4))


@settings(max_examples=40)
@given(st.lists(STEP, max_size=10), st.integers(-4, 4))
def test_it_equals_a_map_that_is_made_of_all_final_places(steps, last):
    shown, keyframes, inserted = KeyframeMap(RESOLUTION, LIMIT), [], []
    for number, (step, shift) in enumerate(steps):
        if step == "add":
            keyframes.append(cloud(number))
            shown.add(keyframes[-1])
        elif step == "draw":
            shown.draw(MovedBy(0.3 * shift), -np.inf)
        else:
            inserted.append(cloud(number).points)
            shown.insert(inserted[-1])
    place = MovedBy(0.3 * last)
    shown.settle(place)
    assert_same(shown.map.blocks, made_at_once(*inserted, *(place.points(keyframe) for keyframe in keyframes)))
    assert shown.moving == []


def test_a_keyframe_that_moves_leaves_nothing_behind():
    shown = KeyframeMap(RESOLUTION, LIMIT)
    shown.add(cloud(1))
    shown.draw(MovedBy(0.0), -np.inf)
    shown.draw(MovedBy(50.0), -np.inf)
    assert_same(shown.map.blocks, made_at_once(MovedBy(50.0).points(cloud(1))))


def test_a_settled_keyframe_stays_where_it_was_drawn():
    shown = KeyframeMap(RESOLUTION, LIMIT)
    for number in (1, 2):
        shown.add(cloud(number))
    shown.draw(MovedBy(0.0), settled_until=1.0)
    assert len(shown.moving) == 1
    shown.draw(MovedBy(50.0), settled_until=1.0)
    assert_same(shown.map.blocks, made_at_once(cloud(1).points, MovedBy(50.0).points(cloud(2))))


@pytest.mark.parametrize("settled_until", [-np.inf, np.inf])
def test_the_report_is_that_of_the_newest_keyframe(settled_until):
    shown = KeyframeMap(RESOLUTION, LIMIT)
    for number in (1, 2):
        shown.add(cloud(number))
    assert shown.draw(MovedBy(2.0 * LIMIT), settled_until).report.outside == len(cloud(2))


def with_three_keyframes():
    """Return a map of keyframes 0 to 2, of which the oldest is settled."""
    shown = KeyframeMap(RESOLUTION, LIMIT)
    for number in range(3):
        shown.add(cloud(number))
        shown.draw(MovedBy(0.0), 0.0)
    return shown


def test_a_copy_ends_at_a_time_and_leaves_the_map_as_it_was():
    shown, placement = with_three_keyframes(), MovedBy(2.0)
    older = shown.drawn_until(1.0, placement)
    assert_same(older.blocks, made_at_once(cloud(0).points, placement.points(cloud(1))))
    everything = [cloud(0).points, placement.points(cloud(1)), placement.points(cloud(2))]
    assert_same(shown.map.blocks, made_at_once(*everything))


def test_what_is_settled_until_a_time_forgets_the_keyframes_after_it():
    shown = with_three_keyframes()
    shown.settle(MovedBy(2.0), 1.0)
    assert_same(shown.map.blocks, made_at_once(cloud(0).points, MovedBy(2.0).points(cloud(1))))
    assert not shown.moving
