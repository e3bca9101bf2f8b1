"""What is wrong with a recording is found and named, and makes what comes after it uncertain."""

from functools import partial
from time import monotonic

import numpy as np
import pytest
from benchmarks import fault_makers as broken
from benchmarks import rare_faults as rare
from benchmarks.faults import shortened
from benchmarks.harness import mapped_as
from made_recordings import SECONDS, scans_in, strafing, touring, trembling
from made_scans import later

from mlsm_manager.localisation.following import Following
from mlsm_manager.localisation.parameters import LocaliserParameters
from mlsm_manager.odometry.steps import MotionLimits
from mlsm_manager.offline.bag_mapping import with_steady_head
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.self_check.beam_causes import beam_causes
from mlsm_manager.self_check.causes import Cause, ranked, widened
from mlsm_manager.self_check.companions import without_companions
from mlsm_manager.self_check.echo_causes import echo_findings
from mlsm_manager.self_check.live_causes import LiveCauses
from mlsm_manager.self_check.standing import standing_causes
from mlsm_manager.self_check.verdict import Answer
from sonar_processing.beams.beam import Beam, PlacedBeam

pytestmark = pytest.mark.long

WHOLE, LIMITS, MIDDLE = touring(), MotionLimits(), SECONDS / 2.0
START, ASIDE = WHOLE.track.times[0], strafing()
SHORT = {"ahead": shortened(WHOLE, 200.0), "aside": shortened(ASIDE, 200.0)}


def found_in(recording):
    return echo_findings(scans_in(recording), recording.sonar_in_base)


def test_headings_that_tremble_are_smoothed_in_each_scan_of_a_run_that_goes_on():
    noise = np.radians(5.0) * np.random.RandomState(1).normal(size=len(WHOLE.track.times))
    scan, following = scans_in(broken.with_compass_error(WHOLE, noise, False))[2], Following(LIMITS, 1.0, monotonic)
    track = following.taken(scan).track
    assert [cause.text for cause in following.causes()] == ["the compass trembles by about 5 deg"]
    assert np.degrees(np.std(track.poses[:, 2] - WHOLE.track.at(track.times)[:, 2])) < 2.0


def test_what_goes_along_with_the_vehicle_is_left_out():
    heard = rare.hull_heard(WHOLE, 5.0)
    beams, causes = without_companions(heard.beams, WHOLE.track)
    assert [cause.text for cause in causes] == [
        "something 4.9 m away goes along with the vehicle, in 120 deg of the circle"
    ]
    assert not any(one.beam.intensities[round(5.0 / one.beam.range_resolution) + 1] for one in beams[:3])
    assert without_companions(WHOLE.beams, WHOLE.track) == (WHOLE.beams, [])


def _beams(angles, ranges):
    """Return a beam per second, with one echo each."""
    strengths = 100 * (np.abs(0.1 * np.arange(300) - ranges[:, np.newaxis]) < 0.3).astype(np.uint8)
    return [
        PlacedBeam(Beam(round(1e9 * number), "sonar", angle, heard, 0.1), np.eye(4), True)
        for number, (angle, heard) in enumerate(zip(angles, strengths))
    ]


def _turning(beams):
    """Return the track of a vehicle that turns on the spot, once in all."""
    times = np.arange(float(len(beams)))
    return Track(times, np.column_stack([0.0 * times, 0.0 * times, 2.0 * np.pi * times / len(times)]))


@pytest.mark.parametrize("leaves", [0.0, 20.0])
def test_a_wall_that_the_vehicle_follows_does_not_go_along(leaves):
    """In the last 18 % of the time it goes `leaves` m away, and hears anything."""
    angles = np.radians(np.arange(0.0, 3600.0, 3.0))
    times = np.arange(float(len(angles)))
    aside = leaves * np.maximum(times / times[-1] - 0.82, 0.0) / 0.18
    anything = np.random.RandomState(1).uniform(2.0, 25.0, len(angles))
    beams = _beams(angles, np.where(aside > 0.0, anything, 4.0 / np.maximum(np.sin(angles), 0.01)))
    straight = Track(times, np.column_stack([0.1 * times, aside, 0.0 * times]))
    assert without_companions(beams, straight) == (beams, [])


@pytest.mark.parametrize(
    ("other_sector", "other_range", "goes_along"), [(6, 5.2, True), (6, 9.0, False), (20, 5.2, False)]
)
def test_what_goes_along_is_heard_in_sectors_beside_each_other(other_sector, other_range, goes_along):
    """A vehicle that turns hears an echo at 5 m in the sixth of 36 sectors, one in another, elsewhere any range."""
    angles, random = np.radians(np.arange(0.5, 3600.0, 3.0)), np.random.RandomState(1)
    sectors = (np.degrees(angles) // 10 % 36).astype(int)
    ranges = np.select(
        [sectors == 5, sectors == other_sector], [5.0, other_range], random.uniform(2.0, 25.0, len(angles))
    )
    beams = _beams(angles, ranges)
    assert bool(without_companions(beams, _turning(beams))[1]) == goes_along


@pytest.mark.parametrize(("turns", "named"), [(4.0, False), (7.0, True)])
def test_what_the_head_heard_in_few_turns_may_not_go_along(turns, named):
    angles = np.radians(np.arange(0.5, 360.0 * turns, 3.0))
    ahead = np.abs(np.sin(angles / 2.0)) < 0.3
    beams = _beams(angles, np.where(ahead, 5.0, np.random.RandomState(1).uniform(2.0, 25.0, len(angles))))
    assert bool(without_companions(beams, _turning(beams))[1]) == named


@pytest.mark.parametrize(("elsewhere", "named"), [(0.1, True), (0.5, False)])
def test_what_is_heard_as_far_away_in_other_directions_does_not_go_along(elsewhere, named):
    """In a small tank walls are as far away wherever the vehicle turns, in some directions by chance mostly."""
    angles, random = np.radians(np.arange(0.5, 3600.0, 3.0)), np.random.RandomState(1)
    is_near = (np.abs(np.sin(angles / 2.0)) < 0.3) | (random.uniform(size=len(angles)) < elsewhere)
    beams = _beams(angles, np.where(is_near, 5.0, random.uniform(8.0, 25.0, len(angles))))
    assert bool(without_companions(beams, _turning(beams))[1]) == named


@pytest.mark.parametrize("moves", [True, False])
def test_a_compass_alone_is_stuck_where_its_heading_stands_and_the_vehicle_goes_on(moves):
    frozen = broken.odometry_freezes(
        broken.with_compass_error(WHOLE.without_positions(), trembling(WHOLE)), MIDDLE, 40.0
    )
    causes = standing_causes([], frozen.track, moves * WHOLE.track.poses)
    assert [cause.text for cause in causes] == ["the compass stuck for 40 s"] * moves


@pytest.mark.parametrize(
    ("recording", "said"),
    [
        (broken.mount_turned(WHOLE, 180.0), "the sonar is turned by"),
        (broken.mount_turned(WHOLE, -45.0), "the sonar is turned by -4"),
        (broken.mount_upside_down(WHOLE), "the sonar is upside down"),
        (broken.head_slips(WHOLE, MIDDLE, 40.0), "the head slipped by "),
        (broken.range_changed(WHOLE, MIDDLE, 1.5), "the range setting changed untold: reported ranges are 0."),
        (broken.delayed(WHOLE, 8.0), "beams were sent"),
        (rare.axes_swapped(WHOLE), "the odometry's positions are mirrored"),
        (rare.positions_swapped(ASIDE), "the odometry's moves are mirrored"),
        (shortened(broken.half_blind(rare.positions_swapped(ASIDE)), 100.0), "the odometry's moves are mirrored"),
        (rare.compass_reversed(WHOLE, False), "the compass counts the other way, beside positions that are right"),
        (rare.compass_reversed(ASIDE, True), "the compass counts the other way, and positions are reckoned with it"),
        (rare.bottom_lost(WHOLE, MIDDLE, 40.0), "the vehicle was carried by 1"),
    ],
)
def test_the_cause_is_named_under_which_scans_lie_on_each_other(recording, said):
    assert found_in(recording).causes[0].text.startswith(said)


def test_nothing_is_named_where_nothing_is_wrong():
    assert found_in(WHOLE).causes == []
    assert beam_causes(WHOLE.beams) == []
    assert standing_causes(scans_in(WHOLE), WHOLE.track, WHOLE.track.poses) == []


@pytest.mark.parametrize(
    ("recording", "said", "after"),
    [
        (broken.head_stops(WHOLE, MIDDLE, 60.0), "the head stood for 60 s", MIDDLE),
        (broken.head_stops(WHOLE, MIDDLE, 60.0, tells=False), "the head stood for ", MIDDLE),
        (broken.gain_changed(WHOLE, MIDDLE, 0.3), "the gain changed: echoes are 0.3 times as strong", MIDDLE),
        (rare.echoes_double(WHOLE, 0.7), "echoes come twice", np.nan),
        (broken.half_blind(WHOLE), "the sonar hears nothing in 170 deg of its circle", np.nan),
    ],
)
def test_beams_show_what_is_wrong_with_the_sonar(recording, said, after):
    (cause,) = beam_causes(recording.beams)
    assert cause.text.startswith(said)
    np.testing.assert_allclose(cause.begin - START, after, atol=12.0)


def test_a_head_whose_angles_tremble_is_named_and_turns_steadily_afterwards():
    steady, (cause,) = with_steady_head(rare.head_trembles(WHOLE, 6.0))
    assert cause.text == "the head's angles tremble by 6 deg"
    assert cause.is_mended
    assert len(scans_in(steady)) == len(scans_in(WHOLE))


def test_a_head_whose_angles_do_not_tremble_is_left_as_it_is():
    assert with_steady_head(WHOLE) == (WHOLE, [])


def _of_walls(places, track):
    """Return a scan of 10 s of a wall at x = each of `places` [m]."""
    scans = []
    for number, place in enumerate(places):
        heard = 10.0 * number + np.linspace(0.0, 10.0, 50)
        points = np.column_stack([np.full(50, place), np.linspace(0.0, 0.1, 50), np.zeros(50), np.ones(50)])
        scans.append(Scan(points, heard, np.zeros(50, dtype=bool), track, heard[-1]))
    return scans


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
    noise = 1e-4 * np.random.RandomState(1).normal(size=len(times)) * (until > 0.0)
    track = Track(times, np.column_stack([0.1 * np.cumsum(speeds), np.zeros(len(times)), noise]))
    assert [cause.text for cause in standing_causes([], track, track.poses)] == ["odometry frozen for 20 s,"] * named


def test_a_measured_pose_that_stands_is_named_frozen_where_poses_are_left_out_before():
    """It goes until 60 s, without poses from 20 to 40 s, and stands suddenly."""
    times = np.concatenate([np.arange(0.0, 20.0, 0.1), np.arange(40.0, 101.0, 0.1)])
    noise = 1e-4 * np.random.RandomState(1).normal(size=len(times)) * (times < 60.0)
    track = Track(times, np.column_stack([0.3 * np.minimum(times, 60.0), np.zeros(len(times)), noise]))
    assert [cause.begin for cause in standing_causes([], track, track.poses)] == [pytest.approx(60.0, abs=0.2)]


@pytest.mark.parametrize(("measured", "step", "named"), [(True, 0.7, True), (False, 0.7, False), (True, 0.1, False)])
def test_a_measured_pose_that_stands_is_named_frozen_unless_scans_show_that_the_vehicle_stands(measured, step, named):
    """Four scans a metre apart while the odometry goes, six `step` [m] apart while it stands, as along a wall."""
    times = np.arange(0.0, 101.0, 0.1)
    noise = 1e-4 * np.random.RandomState(1).normal(size=len(times)) * (times < 40.0) * measured
    poses = np.column_stack([0.1 * np.minimum(times, 40.0), np.zeros(len(times)), noise])
    found = standing_causes(
        _of_walls([0.0, 1.0, 0.0, 1.0] + [5.0, 5.0 + step] * 3, Track(times, poses)), Track(times, poses), poses
    )
    assert [cause.begin for cause in found] == [40.0] * named


@pytest.mark.parametrize(("begin", "trembles", "named"), [(60.0, True, True), (60.0, False, False), (0.0, True, False)])
def test_a_pose_that_stands_is_named_frozen_where_it_trembles_at_another_rest(begin, trembles, named):
    """It speeds up and slows down evenly between two rests of 20 s, in the one of which from `begin` on it stands."""
    times = np.arange(0.0, 121.0, 0.1)
    other = 60.0 - begin
    rests = np.minimum(*(np.abs(times - rest - 10.0) - 10.0 for rest in (begin, other)))
    noise = 1e-4 * np.random.RandomState(1).normal(size=len(times))
    stands = (times >= begin) & (times <= begin + 20.0)
    measured = ~stands if trembles else rests > 0.0
    places = 0.1 * np.cumsum(0.3 * np.clip(rests / 5.0, 0.0, 1.0))
    track = Track(times, np.column_stack([places, 0.0 * times, noise * measured]))
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


@pytest.mark.parametrize("fault", [lambda one: broken.mount_turned(one, 120.0), broken.mount_upside_down])
def test_a_mount_that_is_put_right_has_no_cause_left(fault):
    recording = fault(SHORT["ahead"])
    mount = found_in(recording).mount
    assert found_in(recording.mounted(mount.turn, mount.is_over)).causes == []


FAULTS = {
    "the odometry's direction of motion is turned by ": ("ahead", rare.positions_swapped),
    "the odometry's moves are mirrored beside its headings": ("aside", rare.positions_swapped),
    "the compass counts the other way, beside ": ("ahead", partial(rare.compass_reversed, positions_follow=False)),
}


@pytest.fixture(scope="module")
def mapped():
    """Return what is mapped of recordings whose ranges are 2 % short, as a parameter says, by what is said of them."""
    reported = {way: rare.sound_faster(recording, 1.0 / 1.02) for way, recording in SHORT.items()}
    recordings = {**reported, **{said: fault(reported[way]) for said, (way, fault) in FAULTS.items()}}
    return {said: mapped_as(recording, "--set", "range_scale=1.02") for said, recording in recordings.items()}


@pytest.mark.parametrize("said", FAULTS)
def test_an_odometry_whose_axes_are_wrong_is_put_right_and_no_check_is_fine(mapped, said):
    found, right = mapped[said], mapped[FAULTS[said][0]]
    trust = found.findings.trust
    assert f"mended: {said}" in trust.line
    assert {verdict.answer for verdict in trust.verdicts} <= {Answer.DOUBTFUL, Answer.NOT_MEASURED}
    apart = (found.run.best - right.run.best)[:, :2]
    assert np.hypot(*(apart - apart[0]).T).max() < 1.0


@pytest.mark.parametrize("said", FAULTS)
def test_a_recording_that_is_mapped_anew_has_its_ranges_corrected_once(mapped, said):
    beams = mapped[said].recording.beams
    assert beams[0].beam.range_resolution == pytest.approx(WHOLE.beams[0].beam.range_resolution)


def test_no_check_of_a_run_with_a_mount_from_the_echoes_is_fine():
    trust = mapped_as(broken.mount_turned(SHORT["ahead"], 120.0), "--fix-mount").findings.trust
    assert {verdict.answer for verdict in trust.verdicts} <= {Answer.DOUBTFUL, Answer.NOT_MEASURED}
    assert "mended: the sonar is turned by" in trust.line


@pytest.mark.parametrize(
    ("recording", "said"),
    [
        (WHOLE, []),
        (broken.mount_turned(WHOLE, 120.0), ["the sonar is turned by 12"]),
        (broken.odometry_freezes(WHOLE, MIDDLE, 60.0), ["odometry frozen for "]),
    ],
)
def test_a_run_that_goes_on_names_its_causes_and_knows_its_place_less_with_them(recording, said):
    live = LiveCauses()
    for scan in scans_in(recording):
        live.take(scan, scan.reference_pose)
    live.look()
    assert [cause.text[: len(text)] for cause, text in zip(live.causes([]), said)] == said
    assert (np.trace(live.covariance([])) > 0.25) == bool(said)
    live.clear()
    assert live.causes([]) == []


def test_a_change_is_told_also_when_the_newest_scans_no_longer_show_it():
    live, scans = LiveCauses(), scans_in(broken.head_slips(WHOLE, 60.0, 30.0))
    for scan in scans[:10]:
        live.take(scan, scan.reference_pose)
    live.look()
    for scan in scans_in(WHOLE):
        live.take(later(scan, SECONDS), scan.reference_pose)
    live.look()
    (slipped,) = live.causes([])
    assert slipped.text.startswith("the head slipped by")
    assert slipped.begin == pytest.approx(START + 60.0, abs=10.0)


@pytest.mark.parametrize(
    ("recording", "scans", "said"),
    [
        (broken.compass_drifts(WHOLE, MIDDLE, 4.0), 30, "the compass drifts by +"),
        (broken.compass_steps(WHOLE, 60.0, 28.0, False), 12, "the compass stepped by 28 deg beside positions that are"),
        (rare.bottom_lost(WHOLE, 60.0, 60.0), 14, "the vehicle was carried by "),
    ],
)
def test_a_run_that_goes_on_names_what_only_a_fit_of_its_newest_scans_shows(recording, scans, said):
    localiser = LocaliserParameters().build_localiser(recording.sonar_in_base)
    for scan in scans_in(recording)[:scans]:
        localiser.take_scan(scan)
    localiser.look_for_causes()
    assert localiser.following.causes()[0].text.startswith(said)
    assert np.trace(localiser.following.found.covariance([])) > 0.05


def test_a_compass_that_steps_with_the_positions_is_no_step_beside_right_ones():
    stepping = broken.compass_steps(WHOLE, 60.0, 28.0)
    localiser = LocaliserParameters().build_localiser(stepping.sonar_in_base)
    for scan in scans_in(stepping)[:12]:
        localiser.take_scan(scan)
    localiser.look_for_causes()
    assert [cause.text for cause in localiser.following.causes()] == ["compass stepped by 28 deg"]


def test_scans_that_are_not_matched_are_not_compared():
    localiser = LocaliserParameters().build_localiser()
    localiser.match(False)
    for scan in scans_in(broken.mount_turned(WHOLE, 120.0)):
        localiser.take_scan(scan)
    localiser.look_for_causes()
    assert localiser.following.causes() == []


def test_causes_are_ranked_by_evidence_and_what_was_mended_comes_last():
    small, large, past = Cause("a", 5.0), Cause("b", 50.0), Cause("c", 1e3, is_mended=True)
    assert ranked([past, small, large]) == [large, small, past]


def test_a_cause_makes_what_comes_after_it_uncertain():
    places, times = np.column_stack([np.arange(5.0), np.zeros(5)]), np.arange(5.0)
    turned = Cause("turned", 20.0, begin=2.0, is_mended=True, turn=np.radians(60.0))
    added = np.trace(widened(np.zeros((5, 2, 2)), times, places, [turned]), axis1=1, axis2=2)
    np.testing.assert_allclose(np.sqrt(added), [0.0, 0.0, 0.0, 1.0, 2.0])
