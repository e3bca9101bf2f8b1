"""Faults of the sonar, all along or from a moment on, are found by fitting the run without them, and taken out."""

import numpy as np
import pytest
from benchmarks import fault_makers as broken
from benchmarks.faults import shortened, source
from benchmarks.harness import mapped_as
from benchmarks.rare_faults import compass_sticks, mount_tilted
from made_recordings import touring

from mlsm_manager.joint_solver.sonar_trials import SonarFault, SonarKind, ranges_changed_at
from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.self_check.beam_causes import ranges_are_told

WHOLE, MIDDLE = shortened(touring(), 200.0), 100.0
COMPASS = WHOLE.without_positions()
SHORTEST = shortened(COMPASS, 120.0)
ARM = SonarFault(SonarKind.ARM, np.nan, (2.0, 1.0))
TILT = SonarFault(SonarKind.TILT, np.nan, (0.1, 0.0))
RANGES = SonarFault(SonarKind.RANGES, 1.5, (np.log(2.0),))
SONAR_IN_BASE = np.array([1.0, 0.0])
NAMED = ("--odometry", "heading")  # to try whether the vehicle strafes as well would take longest


@pytest.mark.parametrize(
    ("fault", "said", "places"),
    [  # 2 m ahead is along y of odom, 1 m to the left against x; the first point is from before the change of ranges
        (ARM, "the sonar sits +2.0 m ahead and +1.0 m to the left of where tf says", [[3.0, 6.0], [5.0, 3.0]]),
        (TILT, "the sonar's plane is tilted by about 35 deg against tf", [[4.0, 4.3], [5.8, 1.0]]),
        (RANGES, "the range setting changed untold: reported ranges are 0.50 times the true ones", [[4, 4], [8, 1]]),
    ],
)
def test_a_fault_is_told_as_what_the_sonar_did_and_points_lie_where_they_would_without_it(fault, said, places):
    """The vehicle looks along y of odom at (4, 0) m; its sonar is at (4, 1) m."""
    assert fault.text == said
    track = Track(np.array([0.0, 3.0]), np.tile([4.0, 0.0, np.pi / 2.0], (2, 1)))
    points = np.array([[4.0, 4.0, 0.0, 1.0], [6.0, 1.0, 0.0, 1.0]])
    moved = fault.placed(Scan(points, np.array([1.0, 2.0]), np.zeros(2, dtype=bool), track, 2.0), SONAR_IN_BASE)
    np.testing.assert_allclose(moved.points[:, :2], places, atol=1e-9)


@pytest.mark.parametrize(
    ("recording", "are_told"),
    [
        (WHOLE, False),
        (broken.range_changed(WHOLE, MIDDLE, 0.5), False),
        (broken.range_told(WHOLE, MIDDLE, 0.5), True),
        (broken.range_told(WHOLE, MIDDLE, 0.5, seconds=2.0), False),
    ],
    ids=["none", "untold", "told", "a few beams cut short"],
)
def test_messages_tell_a_change_of_the_range_setting(recording, are_told):
    assert ranges_are_told(recording.sent) == are_told


@pytest.mark.parametrize(("size", "tried"), [(np.log(2.0), 2), (np.log(30.0), 0)])
def test_no_change_of_ranges_is_tried_that_no_setting_makes(size, tried):
    assert len(ranges_changed_at([1.0, 2.0], size)) == tried


@pytest.mark.long
@pytest.mark.parametrize(
    ("recording", "said", "options"),
    [
        (broken.mount_shifted(WHOLE, 2.0), "the sonar sits +", ()),
        (mount_tilted(WHOLE, 25.0), "the sonar's plane is tilted by about 2", ()),
        (broken.range_changed(WHOLE, MIDDLE, 1.5), "the range setting changed untold: reported ranges are 0.6", ()),
        (broken.range_changed(SHORTEST, 60.0, 1.5), "the range setting changed untold: reported ranges", NAMED),
        (broken.range_changed(SHORTEST, 60.0, 1.15), "the range setting changed untold: reported ranges", NAMED),
        (broken.mount_upside_down(SHORTEST), "the sonar is upside down, or its head turns", NAMED),
    ],
    ids=["arm", "tilt", "ranges", "ranges by compass", "a little by compass", "over by compass"],
)
def test_a_fault_is_named_first_and_the_path_fitted_without_it(recording, said, options):
    found = mapped_as(recording, "--refine", *options)
    assert found.findings.trust.causes[0].text.startswith(said)
    assert found.findings.trust.line.startswith("trust: DOUBTFUL")
    truth = WHOLE.track.at(found.run.times) - WHOLE.track.poses[0] + recording.track.poses[0]
    assert np.hypot(*(found.run.best - truth)[:, :2].T).mean() < 0.5  # m


@pytest.mark.long
def test_a_change_of_ranges_is_named_beside_a_compass_where_the_vehicle_passes_near_walls_too():
    passing = shortened(source("harbour compass", 300.0), 200.0, 100.0)
    (cause,) = mapped_as(broken.range_changed(passing, 111.0, 1.37), "--refine", *NAMED).findings.trust.causes
    assert cause.text == "the range setting changed untold: reported ranges are 0.73 times the true ones"
    assert cause.begin == pytest.approx(passing.track.times[0] + 111.0, abs=10.0)


@pytest.mark.long
def test_a_change_of_ranges_is_named_beside_a_compass_where_the_path_went_on_by_the_map():
    recording = broken.range_changed(shortened(source("harbour compass", 400.0), 200.0, 80.0), 102.0, 0.581)
    (cause,) = mapped_as(recording, "--refine", *NAMED).findings.trust.causes
    assert cause.text.startswith("the range setting changed untold: reported ranges are 1.7")


@pytest.mark.long
def test_no_change_of_ranges_is_named_untold_where_messages_tell_them():
    short_at_first = broken.range_told(source("harbour compass", 400.0), 0.0, 0.385, 300.0)
    assert mapped_as(short_at_first, "--refine", *NAMED).findings.trust.causes == []


@pytest.mark.long
def test_a_time_without_echoes_is_named_in_which_the_position_is_lost():
    recording = broken.beams_stop(shortened(source("harbour compass", 400.0), 230.0, 20.0), 108.0, 92.0)
    cause = mapped_as(recording, "--odometry", "hovering").findings.trust.causes[-1]
    assert cause.text.startswith("no echo came for 1")
    assert cause.begin == pytest.approx(recording.track.times[0] + 108.0, abs=10.0)


@pytest.mark.long
def test_where_beams_stop_the_position_is_less_and_less_known_and_the_time_is_named():
    trust = mapped_as(broken.beams_stop(COMPASS, MIDDLE, 100.0), "--refine", *NAMED).findings.trust
    last_scan, end = trust.deviations[-2:]
    assert trust.times[-1] == COMPASS.track.times[-1]
    assert end > 2.0 * last_scan
    assert trust.causes[0].text == "the last fix came 100 s before the end,"
    assert trust.causes[0].begin == pytest.approx(trust.times[-2], abs=1.0)


@pytest.mark.long
@pytest.mark.parametrize(
    "recording",
    [
        shortened(broken.mount_upside_down(COMPASS), 100.0),
        shortened(broken.range_changed(COMPASS, 50.0, 1.5), 100.0),
        broken.range_changed(COMPASS, MIDDLE, 0.5),
        broken.range_changed(shortened(source("harbour compass", 400.0), 280.0, 120.0), 109.0, 0.511),
        compass_sticks(shortened(source("harbour compass", 400.0), 200.0, 180.0), 70.0),
    ],
    ids=["over", "longer ranges", "shorter ranges", "shorter ranges near a wall", "compass stuck"],
)
def test_a_fault_beside_a_compass_alone_does_not_make_the_vehicle_seem_to_strafe(recording):
    found = mapped_as(recording)
    assert found.replayed.strafing is not None
    assert found.odometry.kind is OdometryKind.HEADING
