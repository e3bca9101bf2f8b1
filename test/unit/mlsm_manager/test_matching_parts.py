"""What matching is made of: distributions of a map, the covariance of a fix, and when scan and map are of one place."""

import numpy as np
import pytest
from made_scans import at_velocity, harbour, map_of, prior_of_pose, scan_of, still, wall
from scipy.stats import chi2

from mlsm_manager.scan_matching.distribution_matcher import DistributionMatcher, DistributionMatcherParameters
from mlsm_manager.scan_matching.distributions import LocalDistributions
from mlsm_manager.scan_matching.judgement import agreement
from mlsm_manager.scan_matching.residual_covariance import PointEvidence, residual_covariance


def directions(distributions):
    """Return for each block the angle [rad] of its longer axis from x, between -pi/2 and pi/2."""
    _, vectors = np.linalg.eigh(distributions.covariance)
    return np.arctan(vectors[:, 1, 1] / vectors[:, 0, 1])


def test_a_wall_of_few_noisy_echoes_keeps_its_direction():
    """Three neighbours, a metre apart and scattered by 0.4 m, often lie across the wall."""
    wrong = []
    for seed in range(5):
        echoes = wall((-30, 25), (30, 25), spacing=1.0)
        echoes = echoes + np.random.default_rng(seed).normal(0.0, 0.4, echoes.shape)
        wrong.append(np.quantile(np.abs(directions(LocalDistributions(map_of(echoes)))), 0.9))
    assert np.mean(wrong) < 0.1


def test_points_slide_along_a_wall_up_to_its_mapped_end():
    distributions = LocalDistributions(map_of(wall((-10, 5), (10, 5))))
    assert (distributions.covariance[:, 0, 0] > 5.0**2).all()
    assert (distributions.covariance[:, 1, 1] < 0.3**2).all()


def test_a_buoy_holds_a_point_on_all_sides():
    around = 0.2 * np.column_stack([np.cos(np.arange(6.0)), np.sin(np.arange(6.0))])
    distributions = LocalDistributions(map_of(np.array([8.0, 3.0]) + around))
    assert (np.linalg.eigvalsh(distributions.covariance)[:, 1] < 1.0).all()


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


SCANS = 40
DEVIATIONS = np.array([0.5, 0.5, 0.05, 1e-2, 1e-2, 1e-3, 1e-3, 1e-3])
NOISES = [0.05, 0.3]


def heard(places, position, noise, rng):
    """Return `places` (n, 2) as heard from `position`, their ranges wrong by `noise` m."""
    arms = places - position
    ranges = np.linalg.norm(arms, axis=1, keepdims=True)
    return places + arms / ranges * rng.normal(0.0, noise, ranges.shape)


def matched(scan, target, expected, deviations=DEVIATIONS):
    matcher = DistributionMatcher(DistributionMatcherParameters())
    return matcher.match(scan, target, prior_of_pose(scan, expected, deviations))


def fix(seed, noise):
    """Return the match of a scan to the map of another one, and the true pose; prior and motion are drawn too."""
    rng = np.random.default_rng(seed)
    path = at_velocity(rng.normal(0.0, DEVIATIONS[3:6]), rng.normal(0.0, [1.0, 1.0, 0.3]))
    target = map_of(heard(harbour(), np.zeros(2), noise, rng))
    scan = scan_of(heard(harbour(0.2), path(0.0)[:2], noise, rng), path, still(), moving=True)
    return matched(scan, target, path(16.0) + rng.normal(0.0, DEVIATIONS[:3])), path(16.0)


def normalised_square(result, truth):
    difference = result.pose - truth
    return difference @ np.linalg.solve(result.covariance[:3, :3], difference)


@pytest.mark.long
@pytest.mark.newest_only("a statistic of many fixes; the tests below compute single ones")
@pytest.mark.parametrize("noise", NOISES)
def test_fixes_err_as_much_as_their_covariance_says_whatever_the_noise(noise):
    """Deviations at most 1.4 times too large, and not too small."""
    fixes = [fix(seed, noise) for seed in range(SCANS)]
    squares = np.array([normalised_square(result, truth) for result, truth in fixes if result.accepted])
    assert len(squares) > 0.9 * SCANS
    assert 3.0 / 1.4**2 < squares.mean() < chi2.ppf(0.975, 3 * len(squares)) / len(squares)
    assert squares.max() < 4.0**2


def test_a_scan_without_noise_is_not_infinitely_sure():
    scan = scan_of(harbour(), still())
    deviations = np.sqrt(np.diag(matched(scan, map_of(harbour()), np.zeros(3)).covariance))
    assert (deviations[:2] > 1e-3).all()
    assert deviations[2] > 1e-4


@pytest.mark.long
def test_a_vehicle_that_stands_still_does_not_become_surer_than_the_map():
    """The map was laid by scans like these; were their errors independent, 36 would make a sixth of the deviation."""
    rng = np.random.default_rng(0)
    target = map_of(np.vstack([heard(harbour(), np.zeros(2), 0.15, rng) for _ in range(6)]))
    deviations, found = DEVIATIONS, []
    for _ in range(36):
        scan = scan_of(heard(harbour(0.2), np.zeros(2), 0.15, rng), still())
        result = matched(scan, target, np.zeros(3), deviations)
        deviations = np.sqrt(np.diag(result.state_covariance))
        found.append(deviations[:2])
    assert (found[-1] > found[0] / 3.0).all()


def test_what_the_scan_does_not_tell_is_left_as_sure_as_the_prior_had_it():
    scan = scan_of(wall((-20, 10), (20, 10), offset=0.2), still())
    sure = np.array([0.1, 1.0, 0.1, 1e-3, 1e-3, 1e-4, 1e-3, 1e-3])
    result = matched(scan, map_of(wall((-25, 10), (25, 10))), np.zeros(3), sure)
    assert result.covariance[0, 0] == pytest.approx(0.1**2, rel=0.2)


def test_noise_that_seems_more_than_the_prior_does_not_make_the_vehicle_forget_it():
    """As along a corridor: forty scattered echoes contradict each other by far more than they say."""
    prior = np.diag(DEVIATIONS**-2)
    along = np.eye(8)[0]
    information = np.tile(0.01 * np.outer(along, along), (40, 1, 1))
    gradient = np.resize([2.0, -1.0], 40)[:, np.newaxis] * along
    points = PointEvidence(gradient, information, np.zeros((8, 8)), np.arange(40) // 2, hidden=0.0)
    covariance = residual_covariance(np.zeros(8), points, lambda theta: information.sum(axis=0) @ theta, prior)
    assert covariance[0, 0] <= DEVIATIONS[0] ** 2 * (1.0 + 1e-9)
