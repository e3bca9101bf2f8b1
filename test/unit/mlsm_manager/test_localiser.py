"""The localiser: what live node and recordings share."""

import numpy as np
import pytest
from made_scans import SECONDS, drifting, harbour, scan_of, still

from mlsm_manager.localisation.clouds import MapCloud
from mlsm_manager.localisation.localiser import Localiser, MapInput
from mlsm_manager.localisation.parameters import LocaliserParameters, MlsmCoreParameters
from mlsm_manager.scan_matching.scan import MatchStatus
from node_support.errors import RefusedInput

PARAMETERS = LocaliserParameters(speed_deviation=0.05)


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
    end, pose = taken[-1].scan.scan.reference_time, taken[-1].scan.scan.reference_pose
    for time in (end, end + 2.0):
        correction = localiser.correction(time, pose)
    np.testing.assert_allclose(correction, taken[-1].scan.result.correction(taken[-1].scan.scan), atol=0.05)


def test_where_cleaned_clouds_make_the_map_they_wait_for_the_scan_of_their_time():
    localiser = MlsmCoreParameters(start_matching=True).build_localiser()
    localiser.take_scan(drifting(0))
    assert localiser.take_cloud(MapCloud.of_scan(drifting(1))).waiting
    assert localiser.block_count == 0
    (waited,) = localiser.take_scan(drifting(1)).clouds
    assert waited.report.inserted == len(harbour())


def test_points_in_map_are_inserted_as_they_are():
    localiser, _ = localiser_after(0)
    localiser.take_points(np.array([[1.0, 2.0, 0.0, 9.0]]))
    np.testing.assert_array_equal(localiser.blocks.mean, [[1.0, 2.0, 0.0, 9.0]])


@pytest.mark.parametrize("take", ["take_scan", "take_cloud"])
def test_a_jump_back_in_time_keeps_the_map_and_forgets_the_place(take):
    localiser, _ = localiser_after(8)
    count = localiser.block_count
    assert localiser.notice_time(SECONDS) == 7 * SECONDS
    assert (localiser.believed_until, localiser.block_count) == (None, count)
    early = drifting(0)
    assert getattr(localiser, take)(early if take == "take_scan" else MapCloud.of_scan(early)) is not None


def test_a_scan_that_is_late_by_more_than_half_a_minute_is_refused():
    localiser, _ = localiser_after(8)
    localiser.check_time(8 * SECONDS - 25.0)
    with pytest.raises(RefusedInput, match=r"by 35\.0 s"):
        localiser.check_time(8 * SECONDS - 35.0)


def test_stamps_that_overtake_each_other_by_seconds_are_no_jump():
    localiser, _ = localiser_after(2)
    assert localiser.notice_time(2 * SECONDS - 5.0) == 0.0
    assert localiser.believed_until == 2 * SECONDS


def test_a_long_silence_is_followed_by_the_odometry():
    localiser, _ = localiser_after(1)
    assert localiser.silent_since(SECONDS + 119.0) is None
    assert localiser.silent_since(SECONDS + 121.0) == SECONDS
    localiser.follow(drifting(4).track, SECONDS + 121.0)
    assert localiser.believed_until == SECONDS + 121.0


def test_relocalisation_searches_for_the_newest_scan():
    localiser, _ = localiser_after(2)
    update = localiser.relocalise()
    assert update.accepted, update.result.reason
    np.testing.assert_allclose(update.result.pose, np.zeros(3), atol=0.05)


def test_relocalisation_without_a_scan_finds_nothing():
    assert localiser_after(0)[0].relocalise() is None


def test_clear_forgets_map_and_scan():
    localiser, _ = localiser_after(2)
    count = localiser.block_count
    assert localiser.clear() == count
    assert (localiser.block_count, localiser.believed_until, localiser.relocalise()) == (0, None, None)


def test_matching_is_turned_on_and_off():
    localiser, _ = localiser_after(1)
    assert localiser.match(False)
    assert not localiser.match(False)
    assert localiser.take_scan(drifting(1)).scan.result is None


def test_other_settings_hold_from_the_next_scan_on():
    localiser, _ = localiser_after(1)
    localiser.use(PARAMETERS.changed({"min_points": 10000}).localiser_settings())
    assert localiser.take_scan(drifting(1)).scan.result.status is MatchStatus.TOO_FEW_POINTS
    assert localiser.block_count > 0


def test_a_recording_and_a_live_node_that_matches_make_the_same_localiser():
    live = MlsmCoreParameters(start_matching=True, map_input=MapInput.MATCHED, speed_deviation=0.05).build_localiser()
    recorded, _ = localiser_after(3)
    for turn in range(3):
        live.take_scan(drifting(turn))
    np.testing.assert_allclose(live.blocks.rows, recorded.blocks.rows, rtol=0.0, atol=1e-9)


class Clock:
    """Stands where it is set."""

    now = 100.0

    def __call__(self):
        return self.now


def test_under_an_odometry_without_stamps_a_fix_is_blended_in_and_then_holds():
    clock = Clock()
    localiser = Localiser(PARAMETERS.build_localiser().estimator, PARAMETERS.localiser_settings(), clock)
    np.testing.assert_array_equal(localiser.standing_correction(np.zeros(3)), np.zeros(3))
    localiser.take_scan(scan_of(harbour(), still()))
    localiser.take_scan(scan_of(harbour(), still((1.0, 0.0, 0.0)), still(), start=SECONDS))
    found = []
    for clock.now in (100.0, 100.5, 102.0, 5000.0):
        found.append(localiser.standing_correction(np.zeros(3))[0])
    assert found[0] < found[1] < found[2] == found[3] == pytest.approx(1.0, abs=0.05)
    assert localiser.believed_until == 2 * SECONDS
