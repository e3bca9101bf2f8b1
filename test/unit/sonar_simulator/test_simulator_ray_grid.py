"""Grids of rays as Gazebo sends them, and the contacts made of them."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from node_support.errors import RefusedInput
from sonar_simulator.echoes.ray_grid import Rays, contacts_of_grid, rays_of_points, rays_of_scan

MAX_RANGE = 50.0


def _scan(ranges, angles, step, intensities=()):
    """Return a LaserScan of rays from the first of two angles to the second one."""
    return SimpleNamespace(
        angle_min=angles[0], angle_max=angles[1], angle_increment=step, range_max=MAX_RANGE, ranges=ranges,
        intensities=intensities,
    )  # fmt: skip


def _scan_ahead(ranges, columns, opening, intensities=()):
    step = opening / (columns - 1) if columns > 1 else 0.0
    return _scan(ranges, (-opening / 2, opening / 2), step, intensities)


def _points(ranges, elevations, bearings):
    """As gazebo_ros_block_laser computes them, row after row, in single precision."""
    level = ranges * np.cos(elevations)[:, np.newaxis]
    up = ranges * np.sin(elevations)[:, np.newaxis]
    xyz = np.stack([level * np.cos(bearings), level * np.sin(bearings), up], axis=-1)
    return xyz.reshape(-1, 3).astype(np.float32)


@given(st.integers(1, 12), st.integers(1, 40), st.floats(0.01, 6.2))
def test_a_laser_scan_is_row_after_row_of_its_angles(rows, columns, opening):
    values = np.arange(rows * columns) % 40 + 1.0
    rays = rays_of_scan(_scan_ahead(values, columns, opening), 0.3)
    np.testing.assert_array_equal(rays.ranges, values.reshape(rows, columns))
    assert rays.retro is None
    assert rays.bearings[0] == pytest.approx(-opening / 2)
    assert rays.elevations[-1] == (pytest.approx(0.15) if rows > 1 else 0.0)


@pytest.mark.parametrize("nothing", [math.inf, -math.inf, math.nan, 0.0, MAX_RANGE])
def test_what_gazebo_writes_where_a_ray_hits_nothing_is_no_hit(nothing):
    rays = rays_of_scan(_scan_ahead([5.0, nothing, 7.0], 3, 0.04), 0.0)
    np.testing.assert_array_equal(rays.ranges, [[5.0, math.inf, 7.0]])


def test_the_retro_of_a_laser_scan_goes_with_its_rays():
    rays = rays_of_scan(_scan_ahead([1.0, 2.0, 3.0, 4.0], 2, 0.04, [0.1, 0.2, 0.3, 0.4]), 0.2)
    np.testing.assert_array_equal(rays.retro, [[0.1, 0.2], [0.3, 0.4]])


@given(st.integers(1, 12), st.integers(1, 30), st.floats(0.02, 3.0), st.booleans())
def test_the_rows_of_a_pyramid_of_points_are_found(rows, columns, opening, told):
    ranges = 3.0 + (np.arange(rows * columns) % 7).reshape(rows, columns)
    elevations = np.linspace(-0.19, 0.19, rows) if rows > 1 else np.zeros(1)
    bearings = np.linspace(-opening / 2, opening / 2, columns) if columns > 1 else np.zeros(1)
    rays = rays_of_points(_points(ranges, elevations, bearings), None, rows if told else 0, MAX_RANGE)
    np.testing.assert_allclose(rays.ranges, ranges, rtol=1e-6)
    np.testing.assert_allclose(rays.elevations, elevations, atol=1e-6)
    np.testing.assert_allclose(rays.bearings, bearings, atol=1e-6)


def test_a_point_at_the_range_of_nothing_is_no_hit_in_single_precision_too():
    ranges = np.array([[MAX_RANGE, 49.9, MAX_RANGE]])
    rays = rays_of_points(_points(ranges, np.array([0.1]), np.array([-0.02, 0.0, 0.02])), None, 1, MAX_RANGE)
    np.testing.assert_array_equal(np.isfinite(rays.ranges), [[False, True, False]])


def test_points_all_around_need_their_number_of_rows():
    bearings = np.linspace(-math.pi, math.pi, 361)
    points = _points(np.full((2, 361), 5.0), np.array([-0.1, 0.1]), bearings)
    with pytest.raises(RefusedInput, match="set ray_rows"):
        rays_of_points(points, None, 0, MAX_RANGE)
    assert rays_of_points(points, None, 2, MAX_RANGE).ranges.shape == (2, 361)


@pytest.mark.parametrize(
    ("scan", "text"),
    [
        (_scan_ahead(np.ones(7), 3, 0.1), "7 ranges are not a multiple of the 3 columns"),
        (_scan_ahead(np.empty(0), 3, 0.1), "0 ranges are not a multiple of the 3 columns"),
        (_scan(np.ones(3), (0.0, math.nan), 0.1), "must be finite"),
        (_scan(np.ones(3), (0.0, 1.0), -0.1), "does not lead to angle_max"),
    ],
)
def test_a_laser_scan_that_makes_no_sense_is_refused(scan, text):
    with pytest.raises(RefusedInput, match=text):
        rays_of_scan(scan, 0.0)


@pytest.mark.parametrize("points", [np.empty((0, 3)), [[1.0, math.nan, 0.0]], [[0.0, 0.0, 0.0]]])
def test_points_that_are_no_rays_are_refused(points):
    with pytest.raises(RefusedInput, match="all finite and none at the sensor's centre"):
        rays_of_points(np.array(points), None, 0, MAX_RANGE)


CIRCLE = Rays(
    np.arange(2 * 720.0).reshape(2, 720) + 1.0, np.array([-0.1, 0.1]),
    np.linspace(-math.pi, math.pi, 720, endpoint=False), None,
)  # fmt: skip


@given(st.floats(-math.pi, math.pi))
def test_a_beam_of_a_circle_holds_the_rays_within_its_width(bearing):
    beam = CIRCLE.within(bearing, math.radians(2.5))
    assert 5 <= len(beam.bearings) <= 6
    assert np.abs(beam.bearings).max() <= math.radians(1.25) + 1e-6
    assert (np.diff(beam.bearings) > 0.0).all()
    np.testing.assert_array_equal(beam.ranges[1] - beam.ranges[0], 720.0)


def test_a_beam_between_the_rays_is_refused():
    with pytest.raises(RefusedInput, match=r"no ray within 0\.10 deg of 0\.2 deg"):
        CIRCLE.within(math.radians(0.25), math.radians(0.1))


ELEVATIONS = np.linspace(-0.19, 0.19, 9)
BEARINGS = np.linspace(-0.02, 0.02, 5)


def _wall(turn, rise):
    """Return the ranges of rays to a plane 10 m ahead, turned about z and then tilted, and its incidence cosines."""
    normal = np.array([np.cos(turn) * np.cos(rise), np.sin(turn) * np.cos(rise), np.sin(rise)])
    directions = np.array(
        [[[np.cos(e) * np.cos(b), np.cos(e) * np.sin(b), np.sin(e)] for b in BEARINGS] for e in ELEVATIONS]
    )
    cosines = directions @ normal
    return 10.0 * normal[0] / cosines, cosines


def _contacts(ranges, retro=None):
    return contacts_of_grid(Rays(ranges, ELEVATIONS, BEARINGS, retro))


@given(st.floats(-1.0, 1.0), st.floats(-0.8, 0.8))
def test_incidence_on_a_wall_is_that_of_its_plane(turn, rise):
    ranges, cosines = _wall(turn, rise)
    np.testing.assert_allclose(_contacts(ranges).cosines.reshape(ranges.shape), cosines, atol=1e-9)


def test_the_edge_between_two_walls_does_not_look_like_a_surface():
    ranges, _ = _wall(0.0, 0.0)
    ranges[:, 3:] *= 3.0
    assert _contacts(ranges).cosines.min() > 0.95


def test_one_row_takes_surfaces_as_upright():
    ranges, _ = _wall(0.6, 0.0)
    contacts = contacts_of_grid(Rays(ranges[4:5], ELEVATIONS[4:5], BEARINGS, None))
    np.testing.assert_allclose(contacts.cosines, np.cos(BEARINGS - 0.6)[np.newaxis], atol=1e-9)


def test_a_ray_without_a_range_hits_nothing_and_laser_retro_is_the_reflection_and_0_the_default():
    ranges, _ = _wall(0.0, 0.0)
    ranges[8, 4] = np.inf
    contacts = _contacts(ranges, np.arange(5) / 5.0 * np.ones_like(ranges))
    assert np.flatnonzero(np.isinf(contacts.ranges[0])).tolist() == [44]
    reflections = [contacts.materials[index].reflection for index in contacts.material[0, :5]]
    assert reflections == pytest.approx([0.68, 0.2, 0.4, 0.6, 0.8])
