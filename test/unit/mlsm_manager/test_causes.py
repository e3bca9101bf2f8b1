"""What is wrong with a recording is found and named, and makes what comes after it uncertain."""

from functools import partial
from time import monotonic

import numpy as np
import pytest
from benchmarks import fault_makers as broken
from benchmarks import rare_faults as rare
from benchmarks.faults import shortened, source
from benchmarks.harness import mapped_as
from made_recordings import SECONDS, looked_at, scans_in, strafing, touring
from made_scans import later

from mlsm_manager.joint_solver.batch_solver import fit_of
from mlsm_manager.localisation.following import Following
from mlsm_manager.localisation.parameters import LocaliserParameters
from mlsm_manager.odometry.steps import MotionLimits
from mlsm_manager.offline.heard_scans import with_steady_head, with_turning_head
from mlsm_manager.self_check.beam_causes import beam_causes, head_stood, of_standing
from mlsm_manager.self_check.causes import Cause, ranked, widened
from mlsm_manager.self_check.course import CourseFound
from mlsm_manager.self_check.echo_causes import echo_findings
from mlsm_manager.self_check.live_causes import LiveCauses
from mlsm_manager.self_check.motion_findings import MotionFindings
from mlsm_manager.self_check.standing import standing_causes
from mlsm_manager.self_check.verdict import Answer

pytestmark = pytest.mark.long

WHOLE, LIMITS, MIDDLE = touring(), MotionLimits(), SECONDS / 2.0
START, ASIDE = WHOLE.track.times[0], strafing()
SHORT = {"ahead": shortened(WHOLE, 140.0), "aside": shortened(ASIDE, 140.0)}


def found_in(recording):
    return echo_findings(scans_in(recording), recording.sonar_in_base)


def test_headings_that_tremble_are_smoothed_in_each_scan_of_a_run_that_goes_on():
    noise = np.radians(5.0) * np.random.RandomState(1).normal(size=len(WHOLE.track.times))
    scan, following = scans_in(broken.with_compass_error(WHOLE, noise, False))[2], Following(LIMITS, 1.0, monotonic)
    track = following.taken(scan).track
    assert [cause.text for cause in following.causes()] == ["the compass trembles by about 5 deg"]
    assert np.degrees(np.std(track.poses[:, 2] - WHOLE.track.at(track.times)[:, 2])) < 2.0


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
        (rare.odometry_senseless(WHOLE), "scans lie on each other no better than if they were turned at random"),
        (rare.odometry_senseless(WHOLE).without_positions(), "scans lie on each other no better than if they were"),
        (rare.head_turns_twice(WHOLE), "scans lie on each other no better than if they were turned at random"),
    ],
)
def test_the_cause_is_named_under_which_scans_lie_on_each_other(recording, said):
    assert found_in(recording).causes[0].text.startswith(said)


def test_a_run_may_lie_anywhere_where_stamps_are_so_late_that_scans_meet_by_chance():
    (cause,) = found_in(broken.delayed(source("turning", 300.0), 12.0)).causes
    assert cause.text.startswith("beams were sent 12 s earlier than their stamps")
    assert cause.turn == np.pi
    assert cause.metres > 10.0


def test_nothing_is_named_where_nothing_is_wrong():
    assert with_turning_head(WHOLE) == with_steady_head(WHOLE) == (WHOLE, [])
    assert found_in(WHOLE).causes == []
    assert beam_causes(WHOLE.sent) == []
    assert standing_causes(scans_in(WHOLE), WHOLE.track, WHOLE.track.poses) == []


@pytest.mark.parametrize(
    ("recording", "said", "after"),
    [
        (broken.gain_changed(WHOLE, MIDDLE, 0.3), "the gain changed: echoes are 0.3 times as strong", MIDDLE),
        (rare.echoes_double(WHOLE, 0.7), "echoes come twice", np.nan),
        (broken.half_blind(WHOLE), "the sonar hears nothing in 170 deg of its circle", np.nan),
    ],
)
def test_beams_show_what_is_wrong_with_the_sonar(recording, said, after):
    (cause,) = beam_causes(recording.sent)
    assert cause.text.startswith(said)
    np.testing.assert_allclose(cause.begin - START, after, atol=12.0)


@pytest.mark.parametrize("tells", [True, False])
def test_what_a_head_hears_while_it_stands_is_left_out_and_the_time_is_named(tells):
    stood = broken.head_stops(WHOLE, MIDDLE, 60.0, tells=tells)
    turning, (cause,) = with_turning_head(stood)
    assert cause.text.startswith("the head stood for 60 s" if tells else "the head stood for ")
    assert cause.begin - START == pytest.approx(MIDDLE, abs=12.0)
    left_out = np.setdiff1d(stood.times, turning.times) - START - MIDDLE
    assert left_out.min() == pytest.approx(0.0, abs=6.0)
    assert left_out.max() == pytest.approx(60.0, abs=6.0)
    assert beam_causes(turning.sent) == []


def test_a_head_whose_angles_tremble_is_named_and_turns_steadily_afterwards():
    steady, (cause,) = with_steady_head(rare.head_trembles(WHOLE, 6.0))
    assert cause.text == "the head's angles tremble by 6 deg"
    assert cause.is_mended
    assert len(scans_in(steady)) == len(scans_in(WHOLE))


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


def assert_mended(trust, said):
    assert f"mended: {said}" in trust.line
    assert {verdict.answer for verdict in trust.verdicts} <= {Answer.DOUBTFUL, Answer.NOT_MEASURED}


@pytest.mark.parametrize("said", FAULTS)
def test_an_odometry_whose_axes_are_wrong_is_put_right_and_no_check_is_fine(mapped, said):
    found, right = mapped[said], mapped[FAULTS[said][0]]
    assert_mended(found.findings.trust, said)
    apart = (found.run.best - right.run.best)[:, :2]
    assert np.hypot(*(apart - apart[0]).T).max() < 1.0


@pytest.mark.parametrize("said", FAULTS)
def test_a_recording_that_is_mapped_anew_has_its_ranges_corrected_once(mapped, said):
    beams = mapped[said].recording.beams
    assert beams[0].beam.range_resolution == pytest.approx(WHOLE.beams[0].beam.range_resolution)


def test_no_check_of_a_run_with_a_mount_from_the_echoes_is_fine():
    found = mapped_as(broken.mount_turned(SHORT["ahead"], 120.0), "--fix-mount")
    assert_mended(found.findings.trust, "the sonar is turned by")


def live_causes(scans):
    live = LiveCauses()
    for scan in scans:
        live.take(scan, scan.reference_pose)
    return live


@pytest.mark.parametrize(
    ("recording", "said"),
    [
        (WHOLE, []),
        (broken.mount_turned(WHOLE, 120.0), ["the sonar is turned by 12"]),
        (broken.odometry_freezes(WHOLE, MIDDLE, 60.0), ["odometry frozen for "]),
    ],
)
def test_a_run_that_goes_on_names_its_causes_and_knows_its_place_less_with_them(recording, said):
    live = live_causes(scans_in(recording))
    live.look()
    assert [cause.text[: len(text)] for cause, text in zip(live.causes([]), said)] == said
    assert (np.trace(live.covariance([])) > 0.25) == bool(said)
    live.clear()
    assert live.causes([]) == []


def test_a_run_that_goes_on_names_a_head_that_stands_though_it_reports_that_it_turns():
    stood = broken.head_stops(WHOLE, MIDDLE, np.inf, tells=False)
    live = live_causes(scans_in(stood))
    for beam in stood.sent:
        live.hear(beam)
    live.look()
    assert live.causes([])[0].text.startswith("the head stood for ")


def test_a_run_that_goes_on_leaves_out_what_a_head_hears_that_stands_untold():
    stood, following = broken.head_stops(WHOLE, MIDDLE, 60.0, tells=False), Following(LIMITS, 1.0, monotonic)
    left, stands = [], []
    for scan in scans_in(stood):
        for beam in stood.sent[slice(*np.searchsorted(stood.times, [scan.start, scan.reference_time + 0.01]))]:
            following.found.hear(beam)
        left.append(len(following.taken(scan)) / len(scan))
        stands.append(np.mean((scan.times > START + MIDDLE) & (scan.times < START + MIDDLE + 60.0)))
    left, stands = np.array(left), np.array(stands)
    assert np.count_nonzero(stands == 1.0) > 2
    assert (left[stands == 1.0] == 0.0).all()
    assert (left[stands == 0.0] == 1.0).all()


def test_a_head_that_stands_for_all_of_the_newest_beams_is_known_by_those_before():
    before, usual = head_stood(WHOLE.sent)
    standing = shortened(broken.head_stops(WHOLE, 0.0, np.inf, tells=False), 100.0).sent
    assert before == head_stood(standing)[0] == []
    (cause,) = of_standing(head_stood(standing, usual)[0])
    assert cause.text.startswith("the head stood for 9")


def test_a_change_is_told_also_when_the_newest_scans_no_longer_show_it():
    live = live_causes(scans_in(broken.head_slips(WHOLE, 60.0, 30.0))[:10])
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
    following = looked_at(recording, scans_in(recording)[:scans])
    assert following.causes()[0].text.startswith(said)
    assert np.trace(following.found.covariance([])) > 0.05


@pytest.fixture(scope="module")
def newest():
    """The first scans of the tour as a run that goes on, and a path that is too short to tell a course."""
    localiser = LocaliserParameters().build_localiser(WHOLE.sonar_in_base)
    for scan in scans_in(WHOLE)[:7]:
        localiser.take_scan(scan)
    run = localiser.estimator.session.newest_run(6)
    return MotionFindings(run, fit_of(run), WHOLE.track), shortened(WHOLE, 50.0).track


def test_a_turned_sonar_turns_the_newest_place_about_where_the_run_began(newest):
    motion, track = newest
    turned, here = CourseFound(np.radians(20.0), np.radians(2.0)), motion.run.places[-1]
    near, far = (motion.with_newest_course(track, here - [0.0, gone], turned) for gone in (10.0, 100.0))
    spreads = [np.sqrt(np.trace(each.spread(motion.fit.node_times[-1:])[0])) for each in (near, far)]
    np.testing.assert_allclose(spreads, 2.0 * np.sin(turned.unexplained / 2.0) * np.array([10.0, 100.0]), rtol=0.01)


@pytest.mark.parametrize(("deviations", "named"), [(2.5, 0), (3.5, 1)])
def test_a_run_that_goes_on_names_a_turned_sonar_from_three_deviations_of_its_course_on(newest, deviations, named):
    motion, track = newest
    turned = CourseFound(deviations * np.radians(3.0), np.radians(3.0))
    assert len(motion.with_newest_course(track, motion.run.places[0], turned).causes) == named


def test_a_compass_that_steps_with_the_positions_is_no_step_beside_right_ones():
    stepping = broken.compass_steps(WHOLE, 60.0, 28.0)
    following = looked_at(stepping, scans_in(stepping)[:12])
    assert [cause.text for cause in following.causes()] == ["compass stepped by 28 deg"]


@pytest.mark.parametrize(("evidence", "looks"), [(10.0, 2), (100.0, 1)], ids=["weak", "strong"])
def test_a_run_that_goes_on_names_a_weak_cause_after_two_looks_in_a_row_have_found_it(monkeypatch, evidence, looks):
    shown = iter([[], [Cause("turned", evidence)], [], [Cause("turned", evidence)], [Cause("turned", evidence + 1.0)]])
    monkeypatch.setattr("mlsm_manager.self_check.live_causes.standing_causes", lambda *_: next(shown))
    live, named = LiveCauses(), []
    for scan in scans_in(WHOLE)[:10]:
        live.take(scan, scan.reference_pose)
        live.look()
        named.append(len(live.causes([])))
    assert named[5:] == ([0, 0, 0, 0, 1] if looks == 2 else [0, 1, 0, 1, 1])


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
