"""What a planar laser would have seen, and what the organised cloud of a turn holds."""

import math

import numpy as np
import pytest
from clouds import SECOND, placed

from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.polar_scan import PolarScan, planar_laser_scan, usual_rays

RAYS, BINS, RESOLUTION = 120, 100, 0.1
STEP = 2 * math.pi / RAYS


def _strengths(distance):
    strengths = np.full(BINS, 3, np.uint8)
    index = int(distance / RESOLUTION)
    if index < BINS:
        strengths[index] = 100
    return strengths


def _scan(distances, numbers=None, shifts=None):
    """Return a scan whose beam k looks at k * 3 deg and hears an echo at its distance."""
    numbers = range(len(distances)) if numbers is None else numbers
    shifts = np.zeros((len(distances), 3)) if shifts is None else shifts
    return PolarScan.of([
        placed(strengths=_strengths(distance), angle=number * STEP, resolution=RESOLUTION, seconds=seconds, shift=shift)
        for seconds, (distance, number, shift) in enumerate(zip(distances, numbers, shifts), 1)
    ])  # fmt: skip


def _laser(scan, **values):
    return planar_laser_scan(scan, SonarToCloudParameters(**values))


def _angles(turn):
    return -math.pi + np.arange(turn.ranges.size) * turn.angle_increment


def test_rays_go_round_from_minus_pi_in_steps_of_the_head_and_take_as_long_as_it():
    turn = _laser(_scan(np.full(RAYS, 5.0)))
    assert (turn.ranges.size, turn.duration) == (RAYS, pytest.approx(RAYS - 1))
    assert turn.angle_increment == pytest.approx(STEP)
    np.testing.assert_allclose(turn.ranges, 5.05, atol=1e-5)


@pytest.mark.parametrize("direction", [1, -1])
def test_the_direction_of_the_head_makes_no_difference(direction):
    numbers = direction * np.arange(RAYS) + 17
    distances = 4.0 + 2.0 * np.cos(numbers * STEP)
    turn = _laser(_scan(distances, numbers))
    np.testing.assert_allclose(turn.ranges, 4.0 + 2.0 * np.cos(_angles(turn)), atol=0.11)


def test_lost_beams_and_beams_without_echo_are_infinitely_far():
    numbers = [number for number in range(RAYS) if number not in (10, 11, 80)]
    distances = [np.inf if number == 30 else 5.0 for number in numbers]
    turn = _laser(_scan(np.minimum(distances, 99.0), numbers), laser_strongest_above=50.0)
    missing = sorted(round((angle % (2 * math.pi)) / STEP) for angle in _angles(turn)[~np.isfinite(turn.ranges)])
    assert missing == [10, 11, 30, 80]
    assert turn.intensities[~np.isfinite(turn.ranges)].tolist() == [0.0] * 4
    assert set(turn.intensities[np.isfinite(turn.ranges)]) == {100.0}


def test_the_nearest_of_two_echoes_in_one_ray_stays():
    assert _laser(_scan([5.0, 2.0, 3.0], [0, 0, 0]), laser_scan_rays=4).ranges.tolist() == [
        np.inf, np.inf, pytest.approx(2.05), np.inf,
    ]  # fmt: skip


def test_what_lies_nearer_than_min_range_is_not_measured():
    turn = _laser(_scan(np.full(RAYS, 0.3)), min_range=0.5, laser_strongest_above=50.0)
    assert np.isinf(turn.ranges).all()
    assert (turn.range_min, turn.range_max) == (0.5, pytest.approx(10.0))


def test_the_first_strong_bin_can_be_taken_instead_of_the_strongest():
    scan = _scan(np.full(RAYS, 8.0))
    scan.strengths[:, 40] = 60
    assert _laser(scan).ranges.max() == pytest.approx(8.05)
    assert _laser(scan, laser_pick="FIRST", laser_first_above=50.0).ranges.max() == pytest.approx(4.05)
    assert _laser(scan, laser_pick="FIRST", laser_first_above=70.0).ranges.max() == pytest.approx(8.05)


def test_a_fixed_number_of_rays_can_be_asked_for():
    assert _laser(_scan(np.full(RAYS, 5.0)), laser_scan_rays=360).ranges.size == 360


def test_gaps_do_not_change_the_number_of_rays():
    assert usual_rays(np.delete(np.arange(RAYS) * STEP, [3, 4, 70])) == RAYS
    assert usual_rays(np.full(5, 1.0)) == usual_rays(np.zeros(1)) == 1


def test_the_cloud_of_a_turn_has_a_row_per_beam_placed_by_its_pose():
    scan = _scan([5.0, 5.0], shifts=[(1.0, 0.0, 0.0), (0.0, 2.0, -3.0)])
    cloud = scan.cloud(SonarToCloudParameters(min_range=0.2))
    rows = cloud.points.reshape(2, BINS, 4)
    assert (cloud.height, cloud.frame_id, cloud.stamp_ns, cloud.organized) == (2, "odom", 2 * SECOND, True)
    np.testing.assert_allclose(rows[0, 2], [1.25, 0.0, 0.0, 3.0], atol=1e-6)
    heading = [0.25 * math.cos(STEP), 2.0 + 0.25 * math.sin(STEP), -3.0, 3.0]
    np.testing.assert_allclose(rows[1, 2], heading, atol=1e-6)
    assert np.isnan(rows[:, :2]).all()
    assert cloud.time_stamps.reshape(2, BINS)[:, 0].tolist() == [-1.0, -2.0]


def test_the_height_limit_removes_bins_of_a_turn():
    scan = _scan([5.0, 5.0], shifts=[(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
    cloud = scan.cloud(SonarToCloudParameters(height_limit=0.0))
    assert np.isnan(cloud.points.reshape(2, BINS, 4)[0]).all()
    assert np.isfinite(cloud.points.reshape(2, BINS, 4)[1, 10:]).all()
