"""The joint estimator: matching on and off, lost and found, and clouds that wait."""

from dataclasses import replace

import numpy as np
import pytest
from made_harbour import SONAR_IN_BASE, tour, without_positions
from made_scans import later

from mlsm_manager.localisation.joint_session import moved
from mlsm_manager.localisation.localiser import MapInput
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.localisation.parameters import MlsmCoreParameters
from mlsm_manager.scan_matching.scan import MapCloud, Track
from node_support.geometry import composed

SCANS = tour(12).scans
WITHOUT_POSITIONS = [without_positions(scan) for scan in SCANS]
PARAMETERS = MlsmCoreParameters(size_x_meters=0.0, size_y_meters=0.0)
HEADING = profile_values(OdometryKind.HEADING)


def localiser_after(count, scans=SCANS, **changes):
    """Return a localiser that has taken the first scans, and its updates."""
    localiser = PARAMETERS.changed(changes).build_localiser(SONAR_IN_BASE)
    return localiser, [localiser.take_scan(scan).scan for scan in scans[:count]]


def off(update, scan):
    """Return by how many metres a scan was put beside where it was heard."""
    return np.hypot(*(update.belief.theta[:2] - scan.reference_pose[:2]))


@pytest.fixture(scope="module")
def run():
    """Return a localiser after six scans, and its updates, which are only looked at."""
    return localiser_after(6)


def test_no_scan_is_rejected_and_those_with_neighbours_give_a_fix(run):
    _, updates = run
    assert all(update.accepted for update in updates)
    assert updates[0].result is None
    assert 100 < updates[-1].result.points_used <= len(SCANS[5])


def test_a_scan_in_which_nothing_is_heard_is_no_fix():
    localiser, _ = localiser_after(5)
    scan = SCANS[5]
    update = localiser.take_scan(scan.without_points(scan.reference_time)).scan
    assert update.result is None
    age = localiser.place_now(scan.reference_time, scan.reference_pose).age
    assert age == pytest.approx(scan.reference_time - SCANS[4].reference_time)


def test_matching_off_and_on_again_goes_on_from_the_same_place():
    localiser, _ = localiser_after(6)
    localiser.match(False)
    localiser.take_scan(SCANS[6])
    assert localiser.verdicts() == []
    localiser.match(True)
    assert off(localiser.take_scan(SCANS[7]).scan, SCANS[7]) < 0.3


def test_a_map_that_was_made_without_matching_is_matched_with():
    localiser, _ = localiser_after(4, start_matching=False)
    localiser.match(True)
    assert localiser.take_scan(SCANS[4]).scan.result.points_used > 20


def test_a_vehicle_that_was_found_again_goes_on_from_there():
    localiser, _ = localiser_after(2)
    update = localiser.relocalise()
    assert update.accepted, update.result.reason
    assert localiser.estimator.session is None
    found = localiser.take_scan(SCANS[2]).scan
    assert found.result is not None
    assert off(found, SCANS[2]) < 0.5


def test_a_cloud_from_before_the_run_stays_where_the_odometry_had_it():
    localiser, _ = localiser_after(1, SCANS[5:], map_input=MapInput.CLEANED)
    early = MapCloud.of_scan(SCANS[3])
    assert localiser.take_cloud(early).report.inserted == len(early)
    low, high = early.points[:, :2].min(axis=0), early.points[:, :2].max(axis=0)
    means = localiser.blocks.mean[:, :2]
    assert ((means >= low - 1e-6) & (means <= high + 1e-6)).all()


def test_points_beyond_the_limit_are_counted_before_anybody_looks_at_the_map():
    limit = float(np.median(np.abs(SCANS[1].points[:, :2]).max(axis=1)))
    localiser, _ = localiser_after(1, map_limit=limit)
    (update,) = localiser.take_scan(SCANS[1]).clouds
    assert update.report.outside == pytest.approx(len(SCANS[1]) / 2, rel=0.1)
    assert update.report.inserted + update.report.outside == len(SCANS[1])


def test_a_long_silence_is_followed_by_the_odometry():
    localiser, _ = localiser_after(3)
    end, later = SCANS[2].reference_time, SCANS[8].reference_time
    assert [localiser.silent_since(end + seconds) for seconds in (119.0, 121.0)] == [None, end]
    localiser.follow(SCANS[8].track, later)
    assert localiser.believed_until == later
    assert off(localiser.take_scan(SCANS[9]).scan, SCANS[9]) < 0.5


def test_a_run_says_whether_it_can_be_trusted(run):
    assert [verdict.fires for verdict in run[0].verdicts()] == [False, False, False]


def test_the_first_turn_is_not_doubted_for_a_speed_that_only_the_second_tells():
    for turns in (1, 2):
        names = [verdict.name for verdict in localiser_after(turns)[0].verdicts()]
        assert ("position uncertainty" in names) == (turns == 2)


def test_a_run_without_a_dvl_says_whether_its_scans_lie_on_those_before():
    localiser, _ = localiser_after(22, tour(22).scans, odometry=OdometryKind.HEADING)
    first, again = (next(v for v in localiser.verdicts() if v.name == "scans go on") for _ in range(2))
    assert first.limit < first.value <= 1.0
    assert again.value == first.value


@pytest.mark.parametrize(("deviation", "seconds"), [(0.0, 0.0), (0.1, 0.3)])
def test_late_beams_make_it_wait_for_odometry(deviation, seconds):
    localiser, _ = localiser_after(0, sonar_delay_deviation=deviation)
    assert localiser.estimator.lookahead == pytest.approx(seconds)


def test_free_space_is_known_between_the_vehicle_and_the_walls(run):
    localiser, _ = run
    free = localiser.free
    assert len(free) > 1000
    assert np.hypot(*(free.centers - SCANS[2].reference_pose[:2]).T).min() < 1.0
    walls = {tuple(cell) for cell in localiser.blocks.cells.tolist()}
    assert len(walls.intersection(map(tuple, free.cells.tolist()))) < 0.2 * len(walls)


@pytest.mark.parametrize(("change", "known"), [({"start_matching": False}, True), ({"carve": False}, False)])
def test_free_space_is_known_without_matching_too_but_not_where_nobody_wants_it(change, known):
    assert (len(localiser_after(3, **change)[0].free) > 1000) == known


def test_a_stored_map_gives_its_free_space_back(run):
    localiser, _ = run
    stored = localiser.stored("map", {}, 0.0, "")
    other, _ = localiser_after(0)
    other.restore(stored, same_odometry=False)
    assert len(other.free) == len(localiser.free)


@pytest.mark.long
def test_where_positions_never_change_the_compass_is_taken_for_all_there_is():
    found, named = (localiser_after(12, WITHOUT_POSITIONS, **values)[0] for values in ({}, HEADING))
    assert found.odometry == "HEADING, because positions never change"
    np.testing.assert_allclose(found.estimator.belief.theta, named.estimator.belief.theta, atol=1e-9)
    assert found.block_count == named.block_count


def test_a_vehicle_that_first_turned_on_the_spot_is_not_taken_for_one_without_positions():
    localiser, _ = localiser_after(1, WITHOUT_POSITIONS)
    assert localiser.odometry.startswith("HEADING")
    for scan in SCANS[1:]:
        localiser.take_scan(scan)
    assert "HEADING" not in localiser.odometry


def test_positions_made_from_estimated_velocities_prove_nothing():
    localiser, _ = localiser_after(5, [*WITHOUT_POSITIONS[:4], SCANS[4]])
    assert localiser.odometry.startswith("HEADING")


def test_a_run_that_was_found_to_have_no_positions_goes_on_after_a_restart():
    (localiser, _), (again, _) = localiser_after(4, WITHOUT_POSITIONS), localiser_after(0)
    assert again.restore(localiser.stored("map", {}, 0.0, "run"), same_odometry=True) == ""
    again.take_scan(WITHOUT_POSITIONS[4])
    assert again.odometry.startswith("HEADING")
    assert again.estimator.session.solver.log.scan_count == 5


def test_a_named_odometry_is_not_asked_for():
    assert localiser_after(3, WITHOUT_POSITIONS, odometry=OdometryKind.DVL)[0].odometry == ""


@pytest.fixture(scope="module")
def nine():
    """Return a localiser after nine scans, and its updates, which are only looked at."""
    return localiser_after(9)


@pytest.mark.parametrize("size", [30.0, 5.0])
def test_a_jump_of_the_odometry_leaves_the_position_where_it_is(nine, size):
    (whole, updates), (jumped, _) = nine, localiser_after(0)
    moment, jump = SCANS[4].reference_time + 3.0, size * np.array([1.0, 0.5, 0.0])
    for scan, other in zip(SCANS, updates):
        track = scan.track.with_poses(scan.track.poses + np.outer(scan.track.times > moment, jump))
        points = scan.points + np.outer(scan.times > moment, [*jump, 0.0])
        update = jumped.take_scan(replace(scan, points=points, track=track)).scan
        assert np.hypot(*(update.belief.theta - other.belief.theta)[:2]) < 0.5
    (step,) = jumped.following.odometry.steps
    assert step.time == pytest.approx(moment, abs=0.5)
    now, pose = SCANS[8].reference_time + 1.0, SCANS[8].reference_pose
    places = [composed(one.following.correction(now, at), at) for one, at in ((jumped, pose + jump), (whole, pose))]
    assert np.hypot(*(places[0] - places[1])[:2]) < 0.5


def test_a_position_grows_old_and_uncertain_where_no_scan_comes():
    localiser, _ = localiser_after(6)
    end, pose = SCANS[5].reference_time, SCANS[5].reference_pose
    places = [localiser.place_now(end + seconds, pose) for seconds in (0.0, 20.0, 67.0)]
    assert [place.age for place in places] == pytest.approx([0.0, 20.0, 67.0])
    assert [place.overdue > 0.0 for place in places] == [False, False, True]
    assert places[0].deviation < places[1].deviation < places[2].deviation


@pytest.mark.long
def test_an_odometry_that_goes_on_over_an_hour_keeps_the_vehicle_in_its_place():
    for hour in (3600.0, -3600.0):
        localiser, _ = localiser_after(6)
        end, pose = SCANS[5].track.times[-1], SCANS[5].track.poses[-1]
        expected = localiser.last_correction
        localiser.following.correction(end, pose)
        assert localiser.notice_time(end + 1.0 + hour, pose) * hour < 0.0
        np.testing.assert_allclose(localiser.following.correction(end + 1.0 + hour, pose), expected, atol=1e-9)
        assert off(localiser.take_scan(later(SCANS[6], hour)).scan, SCANS[6]) < 0.5


def test_a_vehicle_that_stands_is_expected_where_it_was_when_its_clock_is_set_back():
    localiser, scan = localiser_after(0)[0], SCANS[0]
    still = Track(scan.track.times, np.tile(scan.track.poses[-1], (len(scan.track.times), 1)))
    for seconds in (0.0, 20.0, 40.0):
        localiser.take_scan(later(replace(scan, track=still), seconds))
    assert localiser.notice_time(-3600.0, still.poses[-1]) > 0.0
    assert (localiser.is_expected, localiser.is_lost) == (True, False)


def test_an_hour_in_which_the_vehicle_went_elsewhere_is_no_jump_of_the_clock():
    localiser, _ = localiser_after(3)
    localiser.following.correction(SCANS[2].reference_time, SCANS[2].reference_pose)
    assert localiser.notice_time(SCANS[2].reference_time + 3600.0, np.array([40.0, 0.0, 0.0])) == 0.0


def test_where_somebody_points_at_the_vehicle_it_is_searched():
    localiser, _ = localiser_after(6)
    shift, scan = np.array([30.0, -7.0, 0.4]), SCANS[6]
    pose = np.add(scan.reference_pose, (0.4, -0.4, 0.05))
    localiser.expect(pose, np.diag([0.25, 0.25, 0.07]), composed(shift, scan.reference_pose))
    found = localiser.take_scan(moved(scan, shift)).scan
    assert found.accepted
    assert off(found, scan) < 0.3


@pytest.mark.long
def test_after_a_jump_in_time_and_of_the_odometry_the_vehicle_is_found_in_its_map_and_nothing_is_mapped_twice():
    localiser, _ = localiser_after(9)
    before, shift = {tuple(cell) for cell in localiser.blocks.cells.tolist()}, np.array([12.0, -9.0, 0.4])
    localiser.notice_time(-3600.0)
    updates = [localiser.take_scan(moved(scan, shift)).scan for scan in SCANS[3:9]]
    assert [update.accepted for update in updates] == [False] + [True] * 5
    assert off(updates[-1], SCANS[8]) < 0.5
    assert sum(tuple(cell) not in before for cell in localiser.blocks.cells.tolist()) < 0.2 * len(before)


def test_a_recording_that_is_played_again_begins_where_it_began():
    localiser, _ = localiser_after(6)
    localiser.notice_time(1.0)
    assert not localiser.is_lost
    np.testing.assert_array_equal(localiser.last_correction, np.zeros(3))


def test_nothing_is_told_of_a_position_before_the_first_fix():
    localiser, _ = localiser_after(1)
    assert localiser.place_now(SCANS[0].reference_time, SCANS[0].reference_pose) is None
