"""Scans that are matched one by one: map and place out."""

import numpy as np
from made_scans import drifting, elsewhere, harbour, scan_of, still, wall

from mlsm_manager.localisation.clouds import MapCloud
from mlsm_manager.localisation.estimator import MapSettings
from mlsm_manager.localisation.scan_by_scan import ScanByScan
from mlsm_manager.scan_matching.distribution_matcher import (
    DistributionMatcher,
    DistributionMatcherParameters,
    relocalised,
    relocaliser,
)
from mlsm_manager.scan_matching.prediction import OdometryErrors
from mlsm_manager.scan_matching.scan import MatchStatus, Scan

SETTINGS = MapSettings(0.5, 0.5, 1e4, 100, 15)


def estimator_of(matching=True, **changes):
    matcher = DistributionMatcher(DistributionMatcherParameters().changed(changes))
    estimator = ScanByScan(SETTINGS, OdometryErrors(speed_deviation=0.05), matcher)
    estimator.matching = matching
    return estimator


def mapped(scans, **options):
    estimator = estimator_of(**options)
    return estimator, [estimator.add_scan(scan) for scan in scans]


def test_the_first_scan_makes_the_map_where_the_odometry_says():
    estimator, (update,) = mapped([drifting(0)])
    assert update.accepted
    assert update.result is None
    np.testing.assert_array_equal(estimator.correction, np.zeros(3))
    assert len(estimator.matched) > 50


def test_matched_scans_correct_the_odometry():
    estimator, updates = mapped([drifting(turn) for turn in range(4)])
    assert [update.result.status for update in updates[1:]] == [MatchStatus.CONVERGED] * 3
    np.testing.assert_allclose(estimator.belief.theta[:2], updates[0].belief.theta[:2], atol=0.1)


def test_without_matching_the_correction_stays():
    estimator, updates = mapped([drifting(turn) for turn in range(4)], matching=False)
    assert all(update.result is None and update.accepted for update in updates)
    np.testing.assert_array_equal(estimator.correction, np.zeros(3))


def test_a_matched_scan_goes_into_the_map_undistorted():
    """The map does not smear although the odometry drifts; without matching it does."""
    scans = [drifting(turn) for turn in range(5)]
    counts = [len(mapped(scans, matching=matching)[0].matched) for matching in (True, False)]
    assert counts[0] < 0.75 * counts[1]


def test_a_rejected_scan_leaves_map_and_correction_alone():
    estimator, _ = mapped([drifting(0), drifting(1)])
    rows, correction = estimator.matched.blocks.rows.copy(), estimator.correction.copy()
    update = estimator.add_scan(elsewhere(2))
    assert not update.accepted
    assert update.result.reason
    np.testing.assert_array_equal(estimator.matched.blocks.rows, rows)
    np.testing.assert_array_equal(estimator.correction, correction)


def test_after_rejections_the_place_is_less_sure_and_is_found_again():
    estimator, updates = mapped([drifting(0), drifting(1), elsewhere(2), elsewhere(3), drifting(4)])
    deviations = [np.sqrt(update.belief.covariance[0, 0]) for update in updates]
    assert deviations[1] < deviations[2] < deviations[3]
    assert updates[4].accepted
    np.testing.assert_allclose(estimator.belief.theta[:2], updates[0].belief.theta[:2], atol=0.15)


def test_a_cloud_of_a_rejected_scan_stays_out_of_the_map():
    estimator, _ = mapped([drifting(0), drifting(1), elsewhere(2)])
    update = estimator.add_cloud(MapCloud.of_scan(drifting(2)))
    assert update.unplaced > 0.8 * len(harbour())
    assert update.report.inserted < 0.2 * len(harbour())


def test_without_matching_a_cloud_is_inserted_at_once():
    estimator = estimator_of(matching=False)
    update = estimator.add_cloud(MapCloud.of_scan(drifting(0)))
    assert not update.waiting
    assert update.report.inserted == len(harbour())


def test_an_empty_scan_is_rejected_and_nothing_breaks():
    estimator, _ = mapped([drifting(0), drifting(1)])
    empty = drifting(2)
    empty = Scan(np.empty((0, 4)), np.empty(0), np.empty(0, dtype=bool), empty.track, empty.reference_time)
    assert estimator.add_scan(empty).result.status is MatchStatus.TOO_FEW_POINTS


def test_the_belief_can_follow_the_odometry_without_scans():
    estimator, _ = mapped([drifting(0)])
    before = estimator.belief
    estimator.follow(drifting(1).track, 30.0)
    assert estimator.belief.time == 30.0
    assert estimator.belief.covariance[0, 0] > before.covariance[0, 0]


def found(scan, estimator):
    """Return what the search in the whole map makes of a scan."""
    matcher = relocaliser(DistributionMatcherParameters())
    return relocalised(scan, estimator.matched.blocks, matcher, OdometryErrors())


def test_relocalisation_finds_the_place_anywhere_in_the_map():
    estimator, _ = mapped([scan_of(harbour(), still())])
    result = found(scan_of(harbour(), still(), still((40.0, -70.0, 2.5))), estimator)
    assert result.accepted, result.reason
    np.testing.assert_allclose(result.pose, np.zeros(3), atol=0.05)


def test_relocalisation_along_a_wall_is_refused():
    estimator, _ = mapped([scan_of(wall((-20, 10), (20, 10)), still())])
    assert not found(scan_of(wall((-10, 10), (10, 10)), still()), estimator).accepted


def test_relocalisation_in_an_empty_map_is_refused():
    assert found(drifting(0), estimator_of()).status is MatchStatus.TOO_FEW_POINTS
