"""What the matcher of single scans finds, how sure it says it is, when it refuses, and what it is made of."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.matchers import BEAM_WIDTH
from hypothesis import given, settings
from hypothesis import strategies as st
from made_scans import DEVIATIONS, at_velocity, belief_in, harbour, map_of, scan_of, still, wall
from scipy.stats import chi2

from mlsm_manager.scan_matching.distribution_matcher import NEARBY, DistributionMatcher
from mlsm_manager.scan_matching.distributions import LocalDistributions
from mlsm_manager.scan_matching.judgement import agreement
from mlsm_manager.scan_matching.residual_covariance import PointEvidence, residual_covariance
from mlsm_manager.scan_matching.scan import MatchStatus, corrected_points
from mlsm_manager.scan_matching.scan_path import SCALE

FREE_RATES = np.array([1.0, 1.0, 0.1, 0.3, 0.3, 0.03, 1e-3, 1e-3])
MAP, SCAN = map_of(harbour()), scan_of(harbour(), still())
LONG_WALL, BESIDE_WALL = map_of(wall((-25, 10), (25, 10))), scan_of(wall((-20, 10), (20, 10), offset=0.2), still())


def match(scan, target, expected, deviations=DEVIATIONS, **changes):
    matcher = DistributionMatcher(replace(NEARBY, **changes), BEAM_WIDTH, 0.0)
    return matcher.match(scan, target, belief_in(expected, scan, deviations))


@settings(max_examples=8)
@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-0.3, 0.3))
def test_a_pose_is_found_from_a_wrong_expectation(x, y, yaw):
    truth = np.array([1.0, -0.5, 0.3])
    result = match(scan_of(harbour(), still(truth), still((0.3, 0.2, 0.0))), MAP, truth + np.array([x, y, yaw]))
    assert result.status is MatchStatus.CONVERGED, result.reason
    np.testing.assert_allclose(result.pose, truth, atol=0.03)


@settings(max_examples=8)
@given(st.floats(-0.3, 0.3), st.floats(-0.1, 0.1), st.sampled_from([-0.02, 0.0, 0.03]))
def test_a_velocity_that_the_odometry_missed_is_found(along, aside, turn_rate):
    velocity = np.array([along, aside, turn_rate])
    truth = at_velocity(velocity)
    result = match(scan_of(harbour(), truth, still(), moving=True), MAP, truth(16.0), FREE_RATES)
    assert result.status is MatchStatus.CONVERGED, result.reason
    np.testing.assert_allclose(result.velocity, velocity, atol=0.015)
    np.testing.assert_allclose(result.pose, truth(16.0), atol=0.06)


def test_a_matched_scan_is_put_where_its_points_were():
    truth = at_velocity((0.3, 0.0, 0.03))
    scan = scan_of(harbour(), truth, at_velocity((0.2, 0.0, 0.02)), moving=True)
    result = match(scan, MAP, truth(16.0), FREE_RATES)
    points, true_places = corrected_points(scan, result), scan_of(harbour(), truth).points
    assert np.linalg.norm(points[:, :2] - true_places[:, :2], axis=1).max() < 0.15
    np.testing.assert_array_equal(points[:, 2:], scan.points[:, 2:])


def test_the_path_ends_at_the_pose():
    path = at_velocity((0.3, 0.0, 0.03))
    scan = scan_of(harbour(), path)
    result = match(scan, MAP, path(16.0))
    np.testing.assert_allclose(result.beam_poses[-1], result.pose)
    assert result.beam_times[-1] == scan.reference_time


def test_what_lies_beyond_the_reach_of_a_scan_changes_nothing():
    larger = map_of(np.vstack([harbour(), harbour() + np.array([500.0, 0.0])]))
    alone, beside = (match(SCAN, target, [0.5, 0.5, 0.1]) for target in (MAP, larger))
    np.testing.assert_allclose(beside.pose, alone.pose, atol=1e-9)
    np.testing.assert_allclose(beside.covariance, alone.covariance, rtol=1e-6)


def test_a_scale_error_of_the_odometry_is_found_while_it_moves():
    truth = at_velocity((0.3, 0.0, 0.0))
    scan = scan_of(harbour(), truth, at_velocity((0.2, 0.0, 0.0)), moving=True)
    deviations = np.array([1.0, 1.0, 0.1, 1e-3, 1e-3, 1e-4, 0.5, 0.1])
    result = match(scan, MAP, truth(16.0), deviations)
    assert result.belief.theta[SCALE] == pytest.approx(0.5, abs=0.05)


def test_the_prior_keeps_what_it_is_sure_of():
    """The weights are those of the deviations: a certain odometry is not moved by a scan."""
    sure = np.full(8, 1e-4)
    result = match(SCAN, MAP, [0.3, 0.0, 0.0], sure, min_agreement=0.0, min_significance=0.0)
    np.testing.assert_allclose(result.pose, [0.3, 0.0, 0.0], atol=0.01)


def test_a_match_makes_the_prior_surer_and_never_less_sure():
    deviations = np.sqrt(np.diag(match(SCAN, MAP, np.zeros(3)).belief.covariance))
    assert (deviations <= DEVIATIONS * (1.0 + 1e-6)).all()
    assert (deviations[:3] < 0.1 * DEVIATIONS[:3]).all()


def test_along_a_single_wall_a_scan_is_ambiguous_and_the_deviation_that_of_the_prior_but_not_across_it():
    result = match(BESIDE_WALL, LONG_WALL, [0.5, 0.3, 0.02])
    assert result.status is MatchStatus.AMBIGUOUS
    assert "least certain direction" in result.reason
    along, across = np.sqrt(np.diag(result.covariance)[:2])
    assert along > 0.5
    assert across < 0.1
    assert abs(result.pose[1]) < 0.1


def test_beside_a_wall_a_sure_odometry_gives_a_fix():
    """What the wall leaves open the odometry tells."""
    sure = np.array([0.1, 1.0, 0.1, 1e-3, 1e-3, 1e-4, 1e-3, 1e-3])
    result = match(BESIDE_WALL, LONG_WALL, [0.05, 0.5, 0.02], sure)
    assert result.status is MatchStatus.CONVERGED, result.reason
    np.testing.assert_allclose(result.pose, [0.0, 0.0, 0.0], atol=0.1)
    assert result.covariance[0, 0] == pytest.approx(0.1**2, rel=0.2)


def test_two_places_that_look_alike_are_ambiguous():
    """A comb of equal jetties every 3 m."""
    comb = np.vstack([wall((x, 8), (x, 12), spacing=0.3) for x in np.arange(-18.0, 19.0, 3.0)])
    scan = scan_of(comb[np.abs(comb[:, 0]) < 10.0], still())
    result = match(scan, map_of(comb), [1.4, 0.0, 0.0], min_significance=0.0)
    assert result.status is MatchStatus.AMBIGUOUS


@pytest.mark.parametrize(("points", "blocks"), [(0, 100), (14, 100), (100, 0), (100, 2)])
def test_a_scan_or_a_map_of_few_points_tells_nothing(points, blocks):
    places = np.vstack([harbour()] * 2)
    result = match(scan_of(places[:points], still()), map_of(places[:blocks]), np.zeros(3))
    assert result.status is MatchStatus.TOO_FEW_POINTS
    assert "must be 15 or more" in result.reason


# One wall of the harbour's two is there, and so are some posts, but not the rest.
OTHER_PLACE = np.vstack([wall((-12, 12), (14, 12)), wall((-12, 12), (-12, -10)), wall((-8, -8), (8, -8))])
NOISE = [np.random.default_rng(seed).uniform(-20.0, 20.0, (150, 2)) for seed in range(5)]


@pytest.mark.parametrize("places", [OTHER_PLACE, harbour() - 200.0, *NOISE])
def test_scans_of_noise_of_another_place_or_of_one_far_away_are_not_accepted(places):
    assert not match(scan_of(places, still()), MAP, np.zeros(3)).accepted


def test_a_jump_beyond_the_priors_deviations_is_rejected():
    deviations = np.array([0.3, 0.3, 0.1, 1e-3, 1e-3, 1e-4, 1e-3, 1e-3])
    result = match(SCAN, MAP, [0.85, 0.0, 0.0], deviations, max_jump=1.5)
    assert result.status is MatchStatus.REJECTED_JUMP
    assert "standard deviations from where it was expected" in result.reason


def test_a_refinement_that_finds_no_end_says_so():
    result = match(SCAN, MAP, [0.5, 0.5, 0.1], max_steps=1)
    assert result.status is MatchStatus.DIVERGED
    assert "after 1 iterations" in result.reason


def test_an_unmatched_scan_keeps_the_priors_pose():
    result = match(scan_of(harbour()[:3], still()), MAP, [1.0, 2.0, 0.3])
    np.testing.assert_allclose(result.pose, [1.0, 2.0, 0.3])
    np.testing.assert_allclose(np.diag(result.belief.covariance), DEVIATIONS**2, rtol=1e-4)


def test_the_correction_takes_the_odometrys_pose_to_the_matched_one():
    scan = scan_of(harbour(), still((1.0, -0.5, 0.3)), still((0.3, 0.2, 0.0)))
    result = match(scan, MAP, [1.0, -0.5, 0.3])
    x, y, yaw = scan.correction_to(result.pose)
    turned = np.array([x + np.cos(yaw) * 0.3 - np.sin(yaw) * 0.2, y + np.sin(yaw) * 0.3 + np.cos(yaw) * 0.2, yaw])
    np.testing.assert_allclose(turned, result.pose, atol=1e-9)


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


def agreed(points, on_map, blocks):
    return agreement(points, np.broadcast_to(on_map, len(points)), np.zeros(2), blocks)[1]


AHEAD, NEARER = wall((-20, 10), (20, 10)), wall((-20, 6), (20, 6))
ASTERN, BOAT = wall((-20, -10), (20, -10)), wall((-8, 6), (8, 6))


@pytest.mark.parametrize(
    ("points", "on_map", "blocks"),
    [
        (harbour(0.2), True, harbour()),
        (np.vstack([AHEAD, ASTERN]), np.arange(2 * len(AHEAD)) < len(AHEAD), AHEAD),
        (NEARER, True, np.vstack([NEARER, wall((-8, 12), (8, 12))])),
        (AHEAD, True, np.vstack([AHEAD, wall((-5, -10), (5, -10))])),
    ],
    ids=["the mapped place", "echoes where the map has nothing yet", "behind a nearer echo", "where no echo came from"],
)
def test_nothing_speaks_against_a_scan_of_the_mapped_place_nor_what_cannot_be_known(points, on_map, blocks):
    assert agreed(points, on_map, blocks) == pytest.approx(1.0)


def test_echoes_beside_what_the_map_has_in_their_direction_count_against_it():
    points = np.vstack([AHEAD, BOAT])
    assert agreed(points, np.arange(len(points)) < len(AHEAD), AHEAD) == pytest.approx(len(AHEAD) / len(points))


def test_a_mapped_surface_counts_against_it_when_echoes_come_from_behind():
    behind, before = wall((-20, 12), (20, 12)), wall((-4, 6), (4, 6))
    assert agreed(behind, True, np.vstack([behind, before])) < 0.85


FIXES = 40
FIX_DEVIATIONS = np.array([0.5, 0.5, 0.05, 1e-2, 1e-2, 1e-3, 1e-3, 1e-3])
NOISES = [0.05, 0.3]


def heard(places, position, noise, rng):
    """Return `places` (n, 2) as heard from `position`, their ranges wrong by `noise` m."""
    arms = places - position
    ranges = np.linalg.norm(arms, axis=1, keepdims=True)
    return places + arms / ranges * rng.normal(0.0, noise, ranges.shape)


def fix(seed, noise):
    """Return the match of a scan to the map of another one, and the true pose; prior and motion are drawn too."""
    rng = np.random.default_rng(seed)
    path = at_velocity(rng.normal(0.0, FIX_DEVIATIONS[3:6]), rng.normal(0.0, [1.0, 1.0, 0.3]))
    target = map_of(heard(harbour(), np.zeros(2), noise, rng))
    scan = scan_of(heard(harbour(0.2), path(0.0)[:2], noise, rng), path, still(), moving=True)
    return match(scan, target, path(16.0) + rng.normal(0.0, FIX_DEVIATIONS[:3]), FIX_DEVIATIONS), path(16.0)


def normalised_square(result, truth):
    difference = result.pose - truth
    return difference @ np.linalg.solve(result.covariance[:3, :3], difference)


@pytest.mark.long
@pytest.mark.parametrize("noise", NOISES)
def test_fixes_err_as_much_as_their_covariance_says_whatever_the_noise(noise):
    """Deviations at most 1.4 times too large, and not too small."""
    fixes = [fix(seed, noise) for seed in range(FIXES)]
    squares = np.array([normalised_square(result, truth) for result, truth in fixes if result.accepted])
    assert len(squares) > 0.9 * FIXES
    assert 3.0 / 1.4**2 < squares.mean() < chi2.ppf(0.975, 3 * len(squares)) / len(squares)
    assert squares.max() < 4.0**2


def test_a_scan_without_noise_is_not_infinitely_sure():
    deviations = np.sqrt(np.diag(match(SCAN, MAP, np.zeros(3), FIX_DEVIATIONS).covariance))
    assert (deviations[:2] > 1e-3).all()
    assert deviations[2] > 1e-4


@pytest.mark.long
def test_a_vehicle_that_stands_still_does_not_become_surer_than_the_map():
    """The map was laid by scans like these; were their errors independent, 36 would make a sixth of the deviation."""
    rng = np.random.default_rng(0)
    target = map_of(np.vstack([heard(harbour(), np.zeros(2), 0.15, rng) for _ in range(6)]))
    deviations, found = FIX_DEVIATIONS, []
    for _ in range(36):
        scan = scan_of(heard(harbour(0.2), np.zeros(2), 0.15, rng), still())
        result = match(scan, target, np.zeros(3), deviations)
        deviations = np.sqrt(np.diag(result.belief.covariance))
        found.append(deviations[:2])
    assert (found[-1] > found[0] / 3.0).all()


def test_noise_that_seems_more_than_the_prior_does_not_make_the_vehicle_forget_it():
    """As along a corridor: forty scattered echoes contradict each other by far more than they say."""
    prior = np.diag(FIX_DEVIATIONS**-2)
    along = np.eye(8)[0]
    information = np.tile(0.01 * np.outer(along, along), (40, 1, 1))
    gradient = np.resize([2.0, -1.0], 40)[:, np.newaxis] * along
    points = PointEvidence(gradient, information, np.zeros((8, 8)), np.arange(40) // 2, hidden=0.0)
    covariance = residual_covariance(np.zeros(8), points, lambda theta: information.sum(axis=0) @ theta, prior)
    assert covariance[0, 0] <= FIX_DEVIATIONS[0] ** 2 * (1.0 + 1e-9)
