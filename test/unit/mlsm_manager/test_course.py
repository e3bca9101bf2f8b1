"""Whether a vehicle goes where it looks is seen from its path, and what that tells of the sonar's mount."""

import numpy as np
import pytest
from benchmarks import fault_makers as broken
from benchmarks.faults import outcome, shortened, source
from benchmarks.harness import mapped_as
from made_recordings import touring

from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.self_check.course import (
    MOSTLY_ALONE,
    NAMED,
    NOT_TOLD,
    CourseFound,
    course_causes,
    course_of,
    odometry_agrees,
)

WHOLE = shortened(touring(), 200.0)


def going(courses, yaw=0.0, seconds=10.0, metres=5.0):
    """Return the path of a vehicle that looks along `yaw` [rad] and goes some metres along each of `courses` [rad]."""
    places = metres * np.cumsum(np.column_stack([np.cos(courses), np.sin(courses)]), axis=0)
    return Track(seconds * np.arange(len(courses)), np.column_stack([places, np.full(len(courses), yaw)]))


@pytest.mark.long
@pytest.mark.parametrize(("tour", "seconds"), [("turning", 600.0), ("harbour", 140.0)])
def test_what_a_turned_dvl_hides_of_a_turned_sonar_is_stated(tour, seconds):
    """A vehicle that strafes, and one that was not seen for long; their DVLs are turned by 10 degrees."""
    right = source(tour, seconds)
    whole, turned = (mapped_as(one, "--refine") for one in (right, broken.mount_turned(right, 14.0)))
    assert outcome(turned, whole, named="").covered == 1.0
    assert "NOT MEASURED" in turned.findings.trust.line
    assert "direction of the sonar" in turned.findings.trust.line


@pytest.mark.parametrize(("turn", "named"), [(0.0, 0), (3.0, 0), (-12.0, 1), (90.0, 1), (-179.0, 1)])
def test_a_sonar_is_turned_where_the_vehicle_never_goes_ahead(turn, named):
    poses = WHOLE.track.poses + np.radians([0.0, 0.0, turn])
    found = course_of(Track(WHOLE.track.times, poses), np.pi)
    assert np.degrees(found.turn) == pytest.approx(turn, abs=1.0)
    assert len(course_causes(found, NAMED)) == named


@pytest.mark.parametrize(("stretches", "strafes"), [(9, False), (40, True)])
def test_a_vehicle_strafes_only_where_it_was_seen_long_enough(stretches, strafes):
    found = course_of(going(np.linspace(0.0, 2.0 * np.pi, stretches)))
    assert (found.is_told, found.strafes) == (False, strafes)


@pytest.mark.parametrize(
    ("others", "mostly", "strafes"),
    [(1, 0.9, False), (6, 0.9, True), (6, MOSTLY_ALONE, False), (9, MOSTLY_ALONE, True)],
)
def test_a_vehicle_that_often_goes_another_way_has_no_usual_course(others, mostly, strafes):
    found = course_of(going(np.radians([50.0] * (30 - others) + [15.0] * others)), np.pi, mostly)
    assert (found.is_told, found.strafes) == (not strafes, strafes)


@pytest.mark.parametrize(("seconds", "turn", "is_told"), [(50.0, 0.0, False), (5.0, 0.0, True), (50.0, 120.0, True)])
def test_a_course_tells_the_mount_only_better_than_mounts_are_set_unless_it_is_far_off(seconds, turn, is_told):
    """A vehicle that slips by up to 17 deg, every `seconds` to the other side."""
    slipping = np.radians(17.0) * np.sin(np.pi * np.arange(400.0) / seconds)
    found = course_of(going(slipping, np.radians(turn), 1.0, 0.5), np.pi)
    assert np.degrees(found.turn) == pytest.approx(turn, abs=5.0)
    assert (found.is_told, found.strafes) == (is_told, False)


@pytest.mark.parametrize(
    ("now", "expected"),
    [
        (CourseFound(0.25, np.inf), CourseFound(0.3, 0.05)),
        (NOT_TOLD, CourseFound(0.3, 0.05)),
        (CourseFound(0.1, 0.04), CourseFound(0.1, 0.04)),
        (CourseFound(0.7, np.inf, strafes=True), CourseFound(0.7, np.inf, strafes=True)),
    ],
    ids=["vague", "at rest", "another one", "strafes"],
)
def test_a_turn_that_was_told_holds_until_another_is_or_the_vehicle_strafes(now, expected):
    assert now.after(CourseFound(0.3, 0.05)) == expected


def test_courses_that_last_tell_less_of_the_mount_than_as_many_that_change_at_once():
    lasting = np.repeat(np.radians([0.0, 9.0, -12.0, 4.0, 10.0, -7.0, -3.0]), 4)
    changing = lasting.reshape(7, 4).T.ravel()
    assert course_of(going(lasting)).deviation > 1.2 * course_of(going(changing)).deviation


def test_a_vehicle_that_goes_back_tells_nothing_of_the_mount_where_its_odometry_does():
    path = Track(WHOLE.track.times, WHOLE.track.poses + np.radians([0.0, 0.0, 180.0]))
    assert course_causes(course_of(path), NAMED) == []


@pytest.mark.parametrize(("reported", "is_strafing"), [(-30.0, True), (-25.0, True), (0.0, False), (30.0, False)])
def test_a_vehicle_strafes_where_its_odometry_says_so_as_well(reported, is_strafing):
    ahead = WHOLE.track
    path = Track(ahead.times, ahead.poses - np.radians([0.0, 0.0, -30.0]))
    odometry = Track(ahead.times, ahead.poses - np.radians([0.0, 0.0, reported]))
    assert odometry_agrees(course_of(path), odometry) == is_strafing


def test_a_vehicle_that_strafes_tells_nothing_of_the_mount():
    yaws = WHOLE.track.poses[:, 2] + 2.0 * np.sin(WHOLE.track.times / 17.0)
    path = Track(WHOLE.track.times, np.column_stack([WHOLE.track.poses[:, :2], yaws]))
    assert course_causes(course_of(path), NAMED) == []
