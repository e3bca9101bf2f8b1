"""The localiser, which live nodes and recordings share, and scans that are matched one by one: map and place out."""

import numpy as np
import pytest
from benchmarks.matchers import BEAM_WIDTH
from made_open_water import open_water
from made_recordings import scans_in
from made_scans import SECONDS, drifting, elsewhere, harbour, map_of, scan_of, still, wall
from virtual_line import VirtualTime

from mlsm_manager.localisation.keyframe_map import MapSettings
from mlsm_manager.localisation.localiser import Localiser, MapInput
from mlsm_manager.localisation.parameters import EstimatorName, LocaliserParameters, MlsmCoreParameters
from mlsm_manager.localisation.thesis_estimator import ThesisEstimator
from mlsm_manager.odometry.steps import MotionLimits
from mlsm_manager.offline.replay import ReplayParameters, replay
from mlsm_manager.scan_matching.distribution_matcher import EVERYWHERE, NEARBY, DistributionMatcher, relocalised
from mlsm_manager.scan_matching.prediction import OdometryErrors
from mlsm_manager.scan_matching.scan import MapCloud, MatchStatus
from node_support.errors import RefusedInput

PARAMETERS = LocaliserParameters(speed_deviation=0.05)
with_every_estimator = pytest.mark.parametrize("estimator", list(EstimatorName))


def localiser_after(turns, **changes):
    localiser = PARAMETERS.changed(changes).build_localiser()
    return localiser, [localiser.take_scan(drifting(turn)) for turn in range(turns)]


def test_scans_correct_the_odometry_and_make_the_map():
    localiser, taken = localiser_after(4)
    assert [update.scan.result.status for update in taken[1:]] == [MatchStatus.CONVERGED] * 3
    assert localiser.block_count == len(localiser.blocks) > 50
    assert localiser.believed_until == 4 * SECONDS


def test_the_correction_moves_to_a_fix_within_the_blend_time():
    localiser, taken = localiser_after(3)
    scan, result = taken[-1].scan.scan, taken[-1].scan.result
    for time in (scan.reference_time, scan.reference_time + 2.0):
        correction = localiser.following.correction(time, scan.reference_pose)
    np.testing.assert_allclose(correction, scan.correction_to(result.pose), atol=0.05)


@with_every_estimator
def test_where_cleaned_clouds_make_the_map_they_wait_for_the_scan_of_their_time(estimator):
    localiser = MlsmCoreParameters(map_input=MapInput.CLEANED, estimator=estimator).build_localiser()
    localiser.take_scan(drifting(0))
    assert localiser.take_cloud(MapCloud.of_scan(drifting(1))).waiting
    assert localiser.block_count == 0
    (waited,) = localiser.take_scan(drifting(1)).clouds
    assert waited.report.inserted == len(harbour())


def test_points_in_map_are_inserted_as_they_are():
    localiser, _ = localiser_after(0)
    localiser.take_points(np.array([[1.0, 2.0, 0.0, 9.0]]))
    np.testing.assert_array_equal(localiser.blocks.mean, [[1.0, 2.0, 0.0, 9.0]])


@with_every_estimator
@pytest.mark.parametrize("take", ["take_scan", "take_cloud"])
def test_a_jump_back_in_time_keeps_the_map_and_forgets_the_place(take, estimator):
    localiser, _ = localiser_after(4, estimator=estimator)
    count = localiser.block_count
    assert localiser.notice_time(SECONDS) == 3 * SECONDS
    assert (localiser.believed_until, localiser.block_count) == (None, count)
    np.testing.assert_array_equal(localiser.estimator.correction, np.zeros(3))
    early = drifting(0)
    assert getattr(localiser, take)(early if take == "take_scan" else MapCloud.of_scan(early)) is not None


def test_stamps_may_overtake_each_other_by_seconds_but_not_by_half_a_minute():
    localiser, _ = localiser_after(2)
    assert localiser.notice_time(2 * SECONDS - 25.0) == 0.0
    assert localiser.believed_until == 2 * SECONDS
    localiser.check_time(2 * SECONDS - 25.0)
    with pytest.raises(RefusedInput, match=r"by 35\.0 s"):
        localiser.check_time(2 * SECONDS - 35.0)


@pytest.mark.long
def test_relocalisation_finds_the_newest_scan_anywhere_in_the_map_but_believes_no_scan_alone():
    localiser, _ = localiser_after(1, estimator=EstimatorName.THESIS)
    alone = localiser.relocalise()
    assert not alone.accepted
    assert "by this scan alone" in alone.result.reason
    localiser.take_scan(scan_of(harbour(), still(), still((40.0, -70.0, 2.5)), start=SECONDS))
    update = localiser.relocalise()
    assert update.accepted, update.result.reason
    np.testing.assert_allclose(update.result.pose, np.zeros(3), atol=0.05)


@with_every_estimator
def test_clear_forgets_map_and_scans(estimator):
    localiser, _ = localiser_after(2, estimator=estimator)
    count = localiser.block_count
    assert localiser.clear() == count
    assert (localiser.block_count, localiser.believed_until, localiser.relocalise()) == (0, None, None)
    assert localiser.verdicts() == []
    assert localiser.take_scan(drifting(2)).scan.result is None


@with_every_estimator
def test_matching_is_turned_on_and_off(estimator):
    localiser, _ = localiser_after(1, estimator=estimator)
    assert localiser.match(False)
    assert not localiser.match(False)
    assert localiser.take_scan(drifting(1)).scan.result is None


def test_other_settings_hold_from_the_next_scan_on():
    localiser, _ = localiser_after(1, estimator="THESIS")
    localiser.use(PARAMETERS.changed({"estimator": "THESIS", "error_threshold": 0.0}).localiser_settings())
    assert localiser.take_scan(drifting(1)).scan.result.status is MatchStatus.DIVERGED
    assert localiser.block_count > 0


def test_a_recording_and_a_live_node_that_matches_make_the_same_localiser():
    live = MlsmCoreParameters(speed_deviation=0.05).build_localiser()
    recorded, _ = localiser_after(3)
    for turn in range(3):
        live.take_scan(drifting(turn))
    np.testing.assert_allclose(live.blocks.rows, recorded.blocks.rows, rtol=0.0, atol=1e-9)


def test_under_an_odometry_without_stamps_a_fix_is_blended_in_and_then_holds():
    clock = VirtualTime()
    settings = PARAMETERS.localiser_settings()
    localiser = Localiser(PARAMETERS.build_localiser().estimator, settings, MotionLimits(), clock.elapsed)
    np.testing.assert_array_equal(localiser.following.standing_correction(np.zeros(3)), np.zeros(3))
    localiser.take_scan(scan_of(harbour(), still()))
    np.testing.assert_array_equal(localiser.following.standing_correction(np.zeros(3)), np.zeros(3))
    localiser.take_scan(scan_of(harbour(), still((1.0, 0.0, 0.0)), still(), start=SECONDS))
    found = []
    for clock.now in (0.0, 0.5, 2.0, 4900.0):
        found.append(localiser.following.standing_correction(np.zeros(3))[0])
    assert abs(found[0]) < 1e-9 < found[1] < found[2] == found[3] == pytest.approx(localiser.last_correction[0])
    assert localiser.believed_until == 2 * SECONDS


def mapped(scans, matching=True):
    """Return an estimator that matches each scan alone, and its updates."""
    matcher, errors = DistributionMatcher(NEARBY, BEAM_WIDTH, 0.0), OdometryErrors(speed_deviation=0.05)
    estimator = ThesisEstimator(MapSettings(0.5, 0.5, 1e4, 100), errors, matcher)
    estimator.matching = matching
    return estimator, [estimator.add_scan(scan) for scan in scans]


def test_the_first_scan_makes_the_map_where_the_odometry_says():
    estimator, (update,) = mapped([drifting(0)])
    assert update.accepted
    assert update.result is None
    np.testing.assert_array_equal(estimator.correction, np.zeros(3))
    assert len(estimator.matched) > 50


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
    estimator, _ = mapped([], matching=False)
    update = estimator.add_cloud(MapCloud.of_scan(drifting(0)))
    assert not update.waiting
    assert update.report.inserted == len(harbour())


def test_an_empty_scan_is_rejected_and_nothing_breaks():
    estimator, _ = mapped([drifting(0), drifting(1)])
    assert estimator.add_scan(drifting(2).without_points(3 * SECONDS)).result.status is MatchStatus.TOO_FEW_POINTS


def found(heard, known):
    """Return where a scan that hears `heard` (n, 2) is found in the whole map of `known` (m, 2)."""
    matcher = DistributionMatcher(EVERYWHERE, BEAM_WIDTH, 0.0)
    return relocalised(scan_of(heard, still()), map_of(known), matcher, OdometryErrors())


@pytest.mark.long
def test_relocalisation_along_a_wall_is_refused():
    assert not found(wall((-10, 10), (10, 10)), wall((-20, 10), (20, 10))).accepted


@pytest.mark.long
@pytest.mark.parametrize(("aside", "is_found"), [(1.2, True), (5.0, False)])
def test_relocalisation_in_a_map_with_everything_twice_covers_both_poses_of_one_place(aside, is_found):
    result = found(harbour(), np.vstack([harbour(), harbour() + np.array([aside, 0.0])]))
    assert result.accepted == is_found, result.reason
    if is_found:
        assert np.abs(result.pose[0] - np.array([0.0, aside])).max() < 2.0 * np.sqrt(result.covariance[0, 0])


def test_relocalisation_in_an_empty_map_is_refused():
    assert found(harbour(), np.empty((0, 2))).status is MatchStatus.TOO_FEW_POINTS


@pytest.mark.long
@with_every_estimator
def test_noise_and_bubbles_correct_nothing(estimator):
    made, parameters = open_water(25, seed=2), ReplayParameters(estimator=estimator)
    replayed = replay(made, scans_in(made, parameters.echoes()), parameters, lambda _: None)
    assert (len(replayed.updates), replayed.matched) == (25, 0)
    np.testing.assert_allclose(replayed.corrected, replayed.odometry, rtol=0.0, atol=1e-6)
