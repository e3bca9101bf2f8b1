"""Stamps, ranges and beam edges put right."""

import numpy as np
from made_corridor import heard, path

from mlsm_manager.localisation.sensor_model import (
    SensorModel,
    at_beam_edge,
    rescaled,
    restamped,
    without_doubtful_points,
)
from mlsm_manager.matching.problem.scan import Scan, Track


def turning_scan(points, times):
    """Return a scan of a vehicle that turns on the spot by 0.1 rad/s."""
    track = Track(np.arange(0.0, 20.0), np.column_stack([np.zeros((20, 2)), 0.1 * np.arange(20.0)]))
    count = len(points)
    rows = np.column_stack([points, np.zeros(count), np.full(count, 9.0)])
    return Scan(rows, np.asarray(times, dtype=float), np.ones(count, dtype=bool), track, float(max(times)))


def test_a_later_stamp_places_an_echo_by_the_later_heading():
    later = restamped(turning_scan([[10.0, 0.0]], [0.0]), 2.0)
    np.testing.assert_allclose(later.points[0, :2], 10.0 * np.array([np.cos(0.2), np.sin(0.2)]))
    assert (later.times[0], later.reference_time) == (2.0, 2.0)


def test_a_scale_moves_echoes_along_their_beams():
    np.testing.assert_allclose(rescaled(turning_scan([[10.0, 5.0]], [0.0]), 0.9).points[0, :2], [9.0, 4.5])


def wall_from_wide_beam(half_width, distance=10.0):
    """Return what a wide beam hears of the wall x = distance: too near wherever it is met aslant."""
    bearing = np.arange(-1.0, 1.0, 0.03)
    nearest = np.maximum(np.abs(bearing) - half_width, 0.0)
    ranges = distance / np.cos(nearest)
    return turning_scan(ranges[:, np.newaxis] * np.column_stack([np.cos(bearing), np.sin(bearing)]), np.zeros(67))


def test_the_edge_of_the_beam_makes_a_wall_straight():
    bent = wall_from_wide_beam(0.07)
    straight = at_beam_edge(bent, 0.07)
    assert np.ptp(bent.points[:, 0]) > 0.8
    assert np.abs(straight.points[:, 0] - 10.0).mean() < 0.05


def test_a_lone_echo_of_a_wide_beam_is_doubtful():
    scan = wall_from_wide_beam(0.07)
    rows = np.vstack([scan.points, [[-30.0, 0.0, 0.0, 9.0]]])
    lone = Scan(rows, np.zeros(68), np.ones(68, dtype=bool), scan.track, 0.0)
    assert len(at_beam_edge(lone, 0.07)) == 68
    assert without_doubtful_points(lone, 0.07).points[:, 0].min() > 0.0


def test_the_defaults_change_nothing():
    scan = wall_from_wide_beam(0.07)
    np.testing.assert_array_equal(SensorModel().applied(scan).points, scan.points)


def test_scans_of_a_moving_vehicle_keep_times_and_points_together():
    for scan in heard(path(100.0), half_width=0.06):
        found = SensorModel(0.5, 0.98, 0.06).applied(scan)
        assert len(found.points) == len(found.times) == len(found.moving) <= len(scan)
        assert np.isin(found.times, scan.times + 0.5).all()
