"""How honest the covariance of a fix is: errors are compared with it, in scans whose noise nobody told the matcher."""

import numpy as np
import pytest
from made_scans import at_velocity, harbour, map_of, prior_of_pose, scan_of, still, wall
from scipy.stats import chi2

from mlsm_manager.scan_matching.distribution_matcher import DistributionMatcher, DistributionMatcherParameters
from mlsm_manager.scan_matching.residual_covariance import PointEvidence, residual_covariance

pytestmark = pytest.mark.long

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
