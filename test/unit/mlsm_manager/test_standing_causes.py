"""Stretches in which the odometry stands are named where the vehicle, by scans and by what trembles, went on."""

import numpy as np
import pytest
from benchmarks import fault_makers as broken
from made_recordings import SECONDS, scans_in, touring, trembling

from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.self_check.standing import standing_causes

pytestmark = pytest.mark.long

WHOLE, MIDDLE = touring(), SECONDS / 2.0


def _of_walls(places, track):
    """Return a scan of 10 s of a wall at x = each of `places` [m]."""
    scans = []
    for number, place in enumerate(places):
        heard = 10.0 * number + np.linspace(0.0, 10.0, 50)
        points = np.column_stack([np.full(50, place), np.linspace(0.0, 0.1, 50), np.zeros(50), np.ones(50)])
        scans.append(Scan(points, heard, np.zeros(50, dtype=bool), track, heard[-1]))
    return scans


def _measured(times, along, trembles):
    """Return the track of a vehicle that is at x = `along` (n,) [m], and whose heading `trembles` (n,), or not."""
    noise = 1e-4 * np.random.RandomState(1).normal(size=len(times)) * trembles
    return Track(times, np.column_stack([along, np.zeros(len(times)), noise]))


def test_a_frozen_odometry_is_named_where_the_echoes_move_and_not_where_the_vehicle_stands():
    frozen = broken.odometry_freezes(WHOLE, MIDDLE, 60.0)
    (cause,) = standing_causes(scans_in(frozen), frozen.track, WHOLE.track.poses)
    assert cause.text.startswith("odometry frozen for 60 s while the echoes move")
    still = [scan for scan in scans_in(WHOLE)[:1] for _ in range(5)]
    stands = Track(WHOLE.track.times, np.zeros_like(WHOLE.track.poses))
    assert standing_causes(still, stands, stands.poses) == []


def test_a_compass_alone_without_noise_is_not_frozen_where_the_vehicle_goes_straight():
    """Scans are 1.5 m apart on a straight way, and lie near each other while the vehicle turns for 40 s."""
    times = np.arange(0.0, 101.0)
    poses = np.maximum(times - 60.0, 0.0)[:, np.newaxis] * [0.0, 0.0, 0.02]
    track = Track(times, poses)
    assert standing_causes(_of_walls([0.0, 1.5] * 3 + [0.0, 0.1] * 2, track), track, poses) == []


@pytest.mark.parametrize(("slowing", "named"), [(0.0, True), (5.0, False)])
def test_a_measured_pose_that_stands_is_named_frozen_where_no_scans_tell_if_it_stood_suddenly(slowing, named):
    """From 40 to 60 s it stands; `slowing` s before and after, its speed goes down and up evenly."""
    times = np.arange(0.0, 101.0, 0.1)
    until = np.maximum(np.abs(times - 50.0) - 10.0, 0.0)
    speeds = 0.3 * np.clip(until / max(slowing, 1e-9), 0.0, 1.0)
    track = _measured(times, 0.1 * np.cumsum(speeds), until > 0.0)
    assert [cause.text for cause in standing_causes([], track, track.poses)] == ["odometry frozen for 20 s,"] * named


def test_a_measured_pose_that_stands_is_named_frozen_where_poses_are_left_out_before():
    """It goes until 60 s, without poses from 20 to 40 s, and stands suddenly."""
    times = np.concatenate([np.arange(0.0, 20.0, 0.1), np.arange(40.0, 101.0, 0.1)])
    track = _measured(times, 0.3 * np.minimum(times, 60.0), times < 60.0)
    assert [cause.begin for cause in standing_causes([], track, track.poses)] == [pytest.approx(60.0, abs=0.2)]


@pytest.mark.parametrize(("measured", "step", "named"), [(True, 0.7, True), (False, 0.7, False), (True, 0.1, False)])
def test_a_measured_pose_that_stands_is_named_frozen_unless_scans_show_that_the_vehicle_stands(measured, step, named):
    """Four scans a metre apart while the odometry goes, six `step` [m] apart while it stands, as along a wall."""
    times = np.arange(0.0, 101.0, 0.1)
    track = _measured(times, 0.1 * np.minimum(times, 40.0), (times < 40.0) * measured)
    found = standing_causes(_of_walls([0.0, 1.0] * 2 + [5.0, 5.0 + step] * 3, track), track, track.poses)
    assert [cause.begin for cause in found] == [40.0] * named


@pytest.mark.parametrize(("begin", "trembles", "named"), [(60.0, True, True), (60.0, False, False), (0.0, True, False)])
def test_a_pose_that_stands_is_named_frozen_where_it_trembles_at_another_rest(begin, trembles, named):
    """It speeds up and slows down evenly between two rests of 20 s, in the one of which from `begin` on it stands."""
    times = np.arange(0.0, 121.0, 0.1)
    other = 60.0 - begin
    rests = np.minimum(*(np.abs(times - rest - 10.0) - 10.0 for rest in (begin, other)))
    stands = (times >= begin) & (times <= begin + 20.0)
    places = 0.1 * np.cumsum(0.3 * np.clip(rests / 5.0, 0.0, 1.0))
    track = _measured(times, places, ~stands if trembles else rests > 0.0)
    assert [cause.begin for cause in standing_causes([], track, track.poses)] == [begin] * named


def test_pairs_of_scans_that_reach_into_a_frozen_stretch_do_not_tell_how_far_apart_scans_usually_lie():
    """Four scans a metre apart while the odometry goes, six 1.5 m apart while it stands, and 4 m and more between."""
    times = np.arange(0.0, 101.0)
    track = Track(times, np.minimum(times, 40.0)[:, np.newaxis] * [0.1, 0.0, 0.0])
    scans = _of_walls([0.0, 1.0, 0.0, 1.0, 5.0, 6.5, 5.0, 6.5, 5.0, 6.5], track)
    (cause,) = standing_causes(scans, track, track.poses)
    assert cause.text.startswith("odometry frozen for 60 s while the echoes move")


@pytest.mark.parametrize(
    ("moves_on", "begin", "end", "turn"),
    [(0.1, 200.0, 260.0, 60.0), (0.0, 200.0, 260.0, 0.0), (0.1, 340.0, 400.0, 0.0)],
)
def test_headings_after_a_freeze_may_be_wrong_by_what_the_vehicle_turns_elsewhere_in_that_time(
    moves_on, begin, end, turn
):
    """A vehicle that turns by 1 degree per second, or never, and stands from `begin` to `end`, or to its end."""
    times = np.arange(0.0, 401.0)
    since = times - np.clip(times - begin, 0.0, end - begin)
    track = Track(times, np.column_stack([0.1 * since, 0.0 * since, np.radians(10.0 * moves_on * since)]))
    apart = [5.0, 6.5] * round((end - begin) / 20.0)
    scans = _of_walls([0.0, 1.0] * round(begin / 20.0) + apart + [0.0, 1.0] * round((400.0 - end) / 20.0), track)
    (cause,) = standing_causes(scans, track, track.poses)
    assert np.degrees(cause.turn) == pytest.approx(turn, abs=0.1)


@pytest.mark.parametrize("moves", [True, False])
def test_a_compass_alone_is_stuck_where_its_heading_stands_and_the_vehicle_goes_on(moves):
    frozen = broken.odometry_freezes(
        broken.with_compass_error(WHOLE.without_positions(), trembling(WHOLE)), MIDDLE, 40.0
    )
    causes = standing_causes([], frozen.track, moves * WHOLE.track.poses)
    assert [cause.text for cause in causes] == ["the compass stuck for 40 s"] * moves
