"""Walls and circles in scans, which echoes stand alone, and markers that fit a tank as well as a marina."""

import math
from dataclasses import replace

import numpy as np
import pytest
from geometry_msgs.msg import Point
from hypothesis import given
from hypothesis import strategies as st
from visualization_msgs.msg import Marker

from node_support.parameters import ParameterError
from sonar_processing.cloud import Cloud
from sonar_processing.ros.shape_messages import wall_markers
from sonar_processing.shapes.circles import CircleDetector, CircleDetectorParameters, range_differences
from sonar_processing.shapes.echoes import (
    Sightings,
    beam_echoes,
    footprint,
    is_alone,
    is_oblique,
    is_scattered,
    sightings,
)
from sonar_processing.shapes.lines import LineDetector, LineDetectorParameters
from sonar_processing.shapes.ransac import iterations_wanted
from underwater_map_construction.msg import Wall, Walls

STEP = 0.05
NOTHING = Sightings(np.empty((0, 2)), np.empty((0, 2)), np.empty(0, int), np.empty(0, int), np.empty(0), STEP)


def _cloud(xy, stamps=None, strengths=100.0):
    """Return a cloud at z = -2 m, a beam per point unless `stamps` say otherwise."""
    points = np.empty((len(xy), 4), dtype=np.float32)
    points[:, :2], points[:, 2], points[:, 3] = np.asarray(xy).reshape(-1, 2), -2.0, strengths
    stamps = np.arange(1.0, len(xy) + 1.0) if stamps is None else np.asarray(stamps, dtype=float)
    return Cloud(points, stamps, 10**9, "odom")


def _wall(x, y, bearing, length, count=40, noise=0.0, seed=0):
    along = np.linspace(-length / 2.0, length / 2.0, count)
    off = np.random.default_rng(seed).normal(0.0, noise, count)
    direction = np.array([math.cos(bearing), math.sin(bearing)])
    return np.array([x, y]) + np.outer(along, direction) + np.outer(off, [-direction[1], direction[0]])


def _lines(cloud, **values):
    return LineDetector(LineDetectorParameters(**values))(cloud)


def _circles(cloud, **values):
    return CircleDetector(CircleDetectorParameters(**values))(cloud, lambda times: np.zeros((len(times), 2)))


def _seen_circle(center, radius):
    """Return one point for each beam from the origin that meets a circle, on the beam's axis at its mean range."""
    center, step, width = np.asarray(center), 0.0175, 0.0436
    axis, reach = math.atan2(center[1], center[0]), math.asin(radius / np.linalg.norm(center)) + width / 2.0 - 0.002
    bearings = axis + np.arange(-reach + step / 3.0, reach, step)
    units = np.column_stack([np.cos(bearings), np.sin(bearings)])
    return units * (1.0 - range_differences(units, np.zeros_like(units), center, radius, width))[:, np.newaxis]


def test_bins_of_one_beam_make_one_echo_at_their_middle_where_strong_ones_weigh_more():
    xy, strengths = [[9.9, 0.0], [10.0, 0.0], [20.0, 0.0], [0.0, 5.0]], [30.0, 90.0, 50.0, 50.0]
    echoes = beam_echoes(_cloud(xy, stamps=[-1, -1, -1, -2], strengths=strengths), gap=0.5)
    np.testing.assert_allclose(echoes.points, [[9.975, 0.0], [20.0, 0.0], [0.0, 5.0]], atol=1e-5)
    assert echoes.weights.tolist() == [2, 1, 1]
    assert echoes.owner.tolist() == [0, 0, 1, 2]
    assert echoes.time_stamps.tolist() == [1, 1, 2]


def test_the_search_may_end_sooner_when_more_samples_are_good():
    assert iterations_wanted(1.0, 0.99) == 1.0
    assert iterations_wanted(0.25, 0.99) == pytest.approx(math.log(0.01) / math.log(0.75))
    assert iterations_wanted(0.0, 0.99) == iterations_wanted(0.5, 1.0) == math.inf


def test_every_wall_of_a_basin_is_found_with_its_ends():
    sides = [_wall(0, 12, 0.0, 50, 80), _wall(0, -12, 0.0, 50, 70), _wall(25, 0, math.pi / 2, 22, 40)]
    lines = _lines(_cloud(np.concatenate(sides)))
    assert [line.orientation for line in lines] == pytest.approx([math.pi / 2, -math.pi / 2, 0.0], abs=1e-6)
    assert [line.offset for line in lines] == pytest.approx([12.0, 12.0, 25.0])
    assert [line.length for line in lines] == pytest.approx([50.0, 50.0, 22.0])
    assert [line.echoes for line in lines] == [80, 70, 40]


@given(st.floats(-math.pi, math.pi), st.floats(5.0, 50.0), st.integers(0, 2**31 - 1), st.integers(0, 40))
def test_a_noisy_wall_among_stray_echoes_is_found(bearing, distance, seed, strays):
    rng = np.random.default_rng(seed)
    foot = distance * np.array([math.cos(bearing), math.sin(bearing)])
    wall = _wall(*foot, bearing + math.pi / 2.0, 30.0, 60, 0.1, seed)
    lines = _lines(_cloud(np.concatenate([wall, rng.uniform(-60.0, 60.0, (strays, 2))])), n_walls=1)
    assert abs(math.remainder(lines[0].orientation - bearing, 2.0 * math.pi)) < math.radians(1.0)
    assert lines[0].offset == pytest.approx(distance, abs=0.15)


def test_same_seed_and_scan_give_the_same_walls():
    cloud = _cloud(np.random.default_rng(0).uniform(-10, 10, (300, 2)))
    first, second = _lines(cloud, seed=7), _lines(cloud, seed=7)
    assert [line.members.tolist() for line in first] == [line.members.tolist() for line in second]


def test_inliers_are_the_points_of_the_cloud_and_belong_to_one_wall_only():
    cloud = _cloud(np.concatenate([_wall(0, 12, 0.0, 40), _wall(20, 0, math.pi / 2, 40)]))
    members = np.concatenate([line.members for line in _lines(cloud)])
    assert len(np.unique(members)) == len(members) == 80


def test_two_things_far_apart_are_no_wall():
    clumps = np.concatenate([np.random.default_rng(seed).normal([20.0 * seed, 3.0], 0.2, (10, 2)) for seed in (0, 1)])
    assert _lines(_cloud(clumps)) == []


def test_noise_of_single_bins_beside_a_wall_is_no_second_wall():
    wall = np.repeat(_wall(0, 12, 0.0, 40, 40), 10, axis=0)
    wall[:, 1] += np.tile(np.arange(10) * 0.1, 40)
    noise = _wall(0, 10, 0.0, 40, 12)
    stamps = np.concatenate([np.repeat(np.arange(40), 10), 100 + np.arange(12)])
    assert len(_lines(_cloud(np.concatenate([wall, noise]), stamps))) == 1


@pytest.mark.parametrize("xy", [*(5.0 * np.arange(10.0).reshape(5, 2)[:n] for n in (0, 1, 2, 5)), np.ones((50, 2))])
def test_few_points_and_points_in_one_place_are_neither_walls_nor_circles(xy):
    assert _lines(_cloud(xy)) == []
    assert _circles(_cloud(xy)) == []


def test_the_search_ends_when_no_points_are_left_and_those_that_are_not_finite_are_left_out():
    cloud = _cloud(_wall(0, 12, 0.0, 40))
    cloud.points[::5, 1] = np.nan
    (line,) = _lines(cloud, n_walls=10)
    assert line.members.tolist() == [number for number in range(40) if number % 5]
    assert line.echoes == 32


@pytest.mark.parametrize("center", [(10.0, 0.0), (-6.0, 8.0), (0.0, -15.0)])
def test_a_buoy_is_found_behind_its_near_side(center):
    (circle,) = _circles(_cloud(_seen_circle(center, 0.5)), min_radius=0.45, max_radius=0.55)
    np.testing.assert_allclose(circle.center, center, atol=0.1)


def test_circles_stand_beside_walls():
    cloud = _cloud(np.concatenate([_wall(0, 8, 0.0, 20, 40, 0.05), _seen_circle((4.0, -4.0), 0.4)]))
    (circle,) = _circles(cloud)
    np.testing.assert_allclose(circle.center, (4.0, -4.0), atol=0.15)


def test_what_was_seen_from_an_unknown_place_is_no_circle():
    detector = CircleDetector(CircleDetectorParameters())
    assert detector(_cloud(_seen_circle((4.0, -4.0), 0.4)), lambda times: np.full((len(times), 2), np.nan)) == []


def test_radii_in_the_wrong_order_are_refused():
    with pytest.raises(ParameterError, match="min_radius"):
        CircleDetectorParameters(min_radius=0.7)


@pytest.mark.parametrize("distance", [8.0, 20.0])
@pytest.mark.parametrize("step_deg", [2.2, 3.0, 3.8])
def test_a_wall_seen_twice_while_the_vehicle_turns_is_no_row_of_circles(step_deg, distance):
    bearings = math.radians(step_deg) * np.arange(150)
    beams = np.flatnonzero(np.sin(bearings) > 0.2)
    noise = np.random.default_rng(0).normal(0.0, 0.05, len(beams))
    wall = np.column_stack([distance / np.tan(bearings[beams]), distance + noise])
    assert _circles(_cloud(wall, stamps=1.0 + beams)) == []


def test_a_near_piece_of_a_wall_is_no_circle_because_a_line_fits_it_better():
    x = np.arange(-0.5, 0.5, 0.08)
    assert _circles(_cloud(np.column_stack([x, np.full(len(x), 1.6)]))) == []


def test_echoes_from_the_far_side_of_a_circle_make_none():
    bearings = np.linspace(-1.2, 1.2, 3)
    hollow = np.array([8.0, 0.0]) + 0.6 * np.column_stack([np.cos(bearings), np.sin(bearings)])
    assert _circles(_cloud(hollow)) == []


def _seen(ranges, weights=None, lengths=None):
    """Return echoes of neighbouring beams from the origin, 0.5 m apart at 10 m."""
    count = len(ranges)
    bearings = STEP * np.arange(count)
    points = np.column_stack([np.cos(bearings), np.sin(bearings)]) * np.asarray(ranges)[:, np.newaxis]
    weights = np.array(weights or [6] * count)
    lengths = 0.1 * (weights - 1) if lengths is None else np.array(lengths)
    return Sightings(points, np.zeros((count, 2)), np.arange(count), weights, lengths, STEP)


@pytest.mark.parametrize(
    ("other", "clearance", "expected"), [(14.0, 0.7, True), (10.1, 0.1, False), (10.1, 1.0, False)]
)
def test_an_echo_within_the_clearance_or_in_the_next_beam_is_company(other, clearance, expected):
    seen = _seen([10.0, 10.0, other])
    assert is_alone(seen.only([0, 1]), seen.only([2]), NOTHING, clearance) == expected


@pytest.mark.parametrize(("weight", "expected"), [(2, True), (3, False)])
def test_a_faint_echo_in_the_next_beam_is_company_where_it_is_half_as_strong(weight, expected):
    seen = _seen([10.0, 10.0, 10.1], weights=[6, 4, weight])
    assert is_alone(seen.only([0, 1]), NOTHING, seen.only([2]), clearance=0.7) == expected


@pytest.mark.parametrize(("farther", "expected"), [(0.0, False), (0.2, False), (0.5, True), (-0.5, True)])
def test_two_echoes_of_a_wall_met_at_more_than_35_degrees_are_oblique(farther, expected):
    assert is_oblique(_seen([10.0, 10.0 + farther])) == expected


def test_one_beam_that_meets_a_thing_twice_is_not_oblique():
    assert not is_oblique(replace(_seen([10.0, 10.2]), points=np.array([[10.0, 0.0], [10.2, 0.0]])))


@pytest.mark.parametrize(("weight", "length", "expected"), [(4, 0.3, False), (4, 1.0, True), (1, 0.0, False)])
def test_echoes_with_holes_between_their_bins_are_scattered(weight, length, expected):
    group = _seen([10.0, 10.0], weights=[weight] * 2, lengths=[length] * 2)
    assert is_scattered(group, group if weight == 1 else _seen([10.0] * 9)) == expected


def test_the_footprint_is_what_two_neighbouring_beams_cover():
    assert footprint(_seen([20.0, 20.0]), beam_width=0.04) == pytest.approx(20.0 * (STEP + 0.04))


def test_beams_that_heard_nothing_are_counted():
    beams = np.array([0, 1, 2, 3, 9, 10])
    bearings = math.radians(3.0) * beams
    cloud = _cloud(10.0 * np.column_stack([np.cos(bearings), np.sin(bearings)]), stamps=100.0 + 0.133 * beams)
    seen = sightings(beam_echoes(cloud, gap=0.5), np.arange(6), np.zeros((6, 2)))
    assert seen.beams.tolist() == beams.tolist()
    assert seen.step == pytest.approx(math.radians(3.0), abs=1e-6)


def _walls(size, *offsets):
    """Return walls that are `size` m long, `offsets` m away along y."""
    ends = [(Point(0.0, offset, -1.0), Point(size, offset, -1.0)) for offset in offsets]
    return Walls(walls=[Wall(start=start, end=end, sonar_distance=abs(start.y)) for start, end in ends])


def _markers(kind, walls):
    return [marker for marker in wall_markers(walls).markers if marker.type == kind]


@pytest.mark.parametrize(("size", "height"), [(8.0, 0.5), (40.0, 2.5), (200.0, 2.5)])
def test_texts_are_as_large_as_the_scan_allows(size, height):
    (text,) = _markers(Marker.TEXT_VIEW_FACING, _walls(size, 3.0))
    assert text.scale.z == pytest.approx(height)


def test_every_wall_has_its_line_and_a_distance_that_would_lie_on_another_is_left_out():
    walls = _walls(8.0, 4.0, 4.3, -4.0)
    assert len(_markers(Marker.LINE_STRIP, walls)) == 3
    assert [text.text for text in _markers(Marker.TEXT_VIEW_FACING, walls)] == ["4.0 m", "4.0 m"]
