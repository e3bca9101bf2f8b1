"""What no vehicle does is left out of a recorded odometry, and said; what it does not tell is bridged."""

import numpy as np
import pytest
from benchmarks import fault_makers as broken
from benchmarks import rare_faults as rare
from made_recordings import SECONDS, touring, trembling

from mlsm_manager.joint_solver.odometry_log import OdometryLog
from mlsm_manager.odometry.continuous import ContinuousOdometry
from mlsm_manager.odometry.steps import MotionLimits, StepKind, impossible_steps
from mlsm_manager.offline.heard_scans import with_odometry_mended
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import wrapped

WHOLE, LIMITS, MIDDLE = touring(), MotionLimits(), SECONDS / 2.0
START = WHOLE.track.times[0]
TREMBLING = broken.with_compass_error(WHOLE, trembling(WHOLE))
TURNING = broken.with_compass_error(WHOLE, 0.08 * (WHOLE.track.times - START), positions_follow=False)


def assert_ends_as_the_whole(mended, cause):
    assert cause.begin == pytest.approx(START + MIDDLE, abs=0.3)
    apart = mended.track.at(WHOLE.track.times) - WHOLE.track.poses
    assert np.hypot(*apart[-100:, :2].T).max() < 1.0


@pytest.mark.parametrize(
    ("recording", "said"),
    [
        (broken.odometry_jumps(WHOLE, MIDDLE, 30.0), "odometry jumped by 30"),
        (broken.odometry_jumps(WHOLE, MIDDLE, 5.0), "odometry jumped by "),
        (broken.odometry_restarts(WHOLE, MIDDLE), "odometry started again from zero"),
        (broken.odometry_glitches(WHOLE, MIDDLE, 50.0), "odometry jumped by 50"),
        (broken.compass_steps(WHOLE, MIDDLE, 20.0), "compass stepped by 20 deg"),
        (broken.compass_steps(WHOLE, MIDDLE, -8.0), "compass stepped by -8 deg"),
        (broken.compass_steps(WHOLE, MIDDLE, 20.0, positions_follow=False), "compass stepped by 20 deg"),
        (broken.odometry_freezes(WHOLE, MIDDLE, 20.0, goes_on=False), "odometry held for 20 s, and then right again"),
        (broken.odometry_freezes(WHOLE, MIDDLE, 5.0, goes_on=False), "odometry stalled, and missed 1."),
        (broken.odometry_freezes(WHOLE, MIDDLE, 5.0, goes_on=True), "odometry stalled, and missed 1."),
    ],
)
def test_a_step_that_no_vehicle_makes_is_left_out_and_said_and_stalls_are_bridged(recording, said):
    mended, causes = with_odometry_mended(recording, LIMITS)
    assert causes[0].text.startswith(said)
    assert causes[0].is_mended
    assert_ends_as_the_whole(mended, causes[0])


def test_positions_that_never_change_but_jump_are_none_once_the_jump_is_left_out():
    recording = broken.odometry_jumps(WHOLE.without_positions(), MIDDLE, 40.9)
    assert recording.track.reports_positions
    mended, _ = with_odometry_mended(recording, LIMITS)
    assert not mended.track.reports_positions


@pytest.mark.parametrize(("seconds", "is_mended"), [(20.0, True), (60.0, False)])
def test_an_odometry_that_hung_has_the_right_heading_and_has_lost_its_place(seconds, is_mended):
    mended, causes = with_odometry_mended(broken.odometry_hangs(TURNING, MIDDLE, seconds), LIMITS)
    text = f"odometry hung for {seconds:.0f} s, and missed how far the vehicle went,"
    assert [(cause.text, cause.is_mended) for cause in causes] == [(text, is_mended)]
    assert causes[0].begin == pytest.approx(START + MIDDLE, abs=0.3)
    apart = mended.track.at(TURNING.track.times) - TURNING.track.poses
    assert np.abs(wrapped(apart[-100:, 2])).max() < 0.01
    before, after = OdometryLog.of(mended.track).motion(START + MIDDLE + np.array([-1.0, seconds + 1.0])).held
    assert after - before == pytest.approx(seconds, abs=0.3)


def test_beams_are_left_out_where_a_vehicle_that_always_turns_lost_its_heading():
    mended, _ = with_odometry_mended(broken.odometry_hangs(TURNING, MIDDLE, 60.0), LIMITS)
    times = mended.times - START
    assert mended.unplaced == len(TURNING.beams) - len(mended.beams) > 0
    assert not np.any((times > MIDDLE + 0.2) & (times < MIDDLE + 59.8))


def test_what_poses_before_the_end_of_a_stall_were_taken_for_is_not_lost():
    hung = broken.odometry_hangs(WHOLE, MIDDLE, 5.0).track
    odometry = ContinuousOdometry(LIMITS)
    for last in range(20, len(hung.times), 20):
        odometry.take(hung.chosen(slice(max(last - 40, 0), last)))
    assert [step.kind for step in odometry.steps] == [StepKind.POSITIONS]
    assert odometry.steps[0].lost <= hung.times[20] - hung.times[0]


@pytest.mark.parametrize(("recording", "is_measured"), [(TREMBLING, True), (WHOLE, False)])
@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (lambda recording: broken.odometry_freezes(recording, MIDDLE, 20.0), "odometry stalled, and missed "),
        (lambda recording: rare.compass_sticks(recording, MIDDLE), "the compass stuck for "),
    ],
)
def test_what_stands_for_long_is_a_fault_where_headings_are_measured(recording, is_measured, fault, said):
    _, causes = with_odometry_mended(fault(recording), LIMITS)
    assert [cause.text[: len(said)] for cause in causes] == [said] * is_measured


@pytest.mark.parametrize("seconds", [3.0, 20.0])
def test_a_vehicle_goes_on_by_its_compass_while_positions_stand(seconds):
    standing = rare.velocities_missing(WHOLE, seconds, every=MIDDLE)
    mended, causes = with_odometry_mended(standing, LIMITS)
    assert causes[0].text.startswith("positions stood while the heading went on, and missed ")
    assert causes[0].begin == pytest.approx(START + MIDDLE, abs=0.3)
    stood = START + MIDDLE + np.array([-0.1, seconds + 0.1])
    went, mended_way = (np.diff(track.at(stood)[:, :2], axis=0)[0] for track in (WHOLE.track, mended.track))
    assert np.hypot(*(mended_way - went)) < 0.3 * np.hypot(*went)


def test_nobody_knows_how_far_a_vehicle_went_whose_positions_stood():
    mended, _ = with_odometry_mended(rare.velocities_missing(WHOLE, 5.0, every=MIDDLE), LIMITS)
    before, after = OdometryLog.of(mended.track).motion(START + MIDDLE + np.array([-1.0, 40.0])).held
    assert after - before == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize(("recording", "times"), [(WHOLE, 9), (WHOLE.without_positions(), 5)])
def test_an_odometry_that_keeps_stalling_leaves_the_run_doubtful(recording, times):
    """On straight ways a heading tells no stall."""
    _, causes = with_odometry_mended(rare.odometry_stalls(recording, 5.0, every=30.0), LIMITS)
    assert [cause.is_mended for cause in causes] == [False]
    assert causes[0].text.startswith("odometry stalled")
    assert causes[0].text.endswith(f"{times} times, first")


def test_a_vehicle_that_stops_for_a_while_does_not_stall():
    seconds = WHOLE.track.times - START
    goes = 1.0 - np.clip(np.minimum(seconds - MIDDLE, MIDDLE + 11.0 - seconds) / 2.0, 0.0, 1.0)
    steps = broken.steps_of(WHOLE.track.poses) * goes[1:, np.newaxis]
    stopping = WHOLE.track.with_poses(broken.integrated(WHOLE.track.poses[0], steps))
    assert with_odometry_mended(WHOLE.with_track(stopping), LIMITS)[1] == []


def test_many_steps_are_one_cause():
    _, causes = with_odometry_mended(broken.odometry_jumps(WHOLE, 30.0, 1.0, every=30.0), LIMITS)
    assert len(causes) == 1
    assert causes[0].text.endswith("9 times, first")


@pytest.mark.parametrize("begin", [0.0, MIDDLE])
def test_headings_that_tremble_are_smoothed(begin):
    noise = 5.0 * np.random.RandomState(1).normal(size=len(WHOLE.track.times)) * broken.after(WHOLE, begin)
    mended, causes = with_odometry_mended(broken.with_compass_error(WHOLE, np.radians(noise), False), LIMITS)
    assert [cause.text for cause in causes] == ["the compass trembles by about 5 deg"]
    assert causes[0].begin == pytest.approx(START + begin, abs=10.0)
    assert causes[0].is_mended
    assert np.degrees(np.std(mended.track.poses[:, 2] - WHOLE.track.poses[:, 2])) < 2.0


def test_poses_that_are_told_again_and_again_are_left_out():
    times = WHOLE.track.times
    told = Track(times, WHOLE.track.at(times[0] + 2.0 * np.floor((times - times[0]) / 2.0)))
    mended, causes = with_odometry_mended(WHOLE.with_track(told), LIMITS)
    assert [cause.text for cause in causes] == ["the odometry repeats each pose for about 2.0 s"]
    assert np.abs(mended.track.at(times) - WHOLE.track.poses)[:-20].max() < 0.3


def test_positions_that_tremble_are_smoothed():
    mended, causes = with_odometry_mended(rare.odometry_noisy(WHOLE, 0.5), LIMITS)
    assert [cause.text for cause in causes] == ["reported positions tremble by about 0.5 m"]
    assert causes[0].is_mended
    assert np.std(mended.track.poses[:, :2] - WHOLE.track.poses[:, :2]) < 0.2


NOISE = 0.02 * np.random.RandomState(0).normal(size=WHOLE.track.poses.shape)
ROUNDED = rare.odometry_rounded(broken.odometry_scaled(TREMBLING, 0.2), 0.1, 0.01)
NOISY = WHOLE.with_track(WHOLE.track.with_poses(WHOLE.track.poses + NOISE))


@pytest.mark.parametrize("recording", [WHOLE, NOISY, ROUNDED], ids=["whole", "noisy", "rounded"])
def test_an_odometry_without_steps_stays_as_it_is(recording):
    assert with_odometry_mended(recording, LIMITS) == (recording, [])


def test_a_gap_in_which_the_vehicle_went_on_is_no_step():
    recording = broken.odometry_missing(WHOLE, MIDDLE, 60.0)
    assert not len(impossible_steps(recording.track, LIMITS))
