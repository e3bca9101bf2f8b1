"""How map_bag takes recordings: corrected, scan by scan, and what it leaves of a run in its folder and says of it."""

import json
from dataclasses import replace

import matplotlib.colors
import matplotlib.image
import numpy as np
import pytest
from made_harbour import SONAR_IN_BASE, tour, with_wild_odometry
from made_maps import blocks_of

from georeferencing.asked import AskedOrigin
from georeferencing.origin import STORED as STORED_ORIGIN
from georeferencing.origin import Origin
from mlsm_manager.offline.charts import origin_of_fixes, satellite_fixes
from mlsm_manager.offline.recording import Recording, Truth, scans_of
from mlsm_manager.offline.replay import CORRECTED, ODOMETRY, ReplayParameters, replay
from mlsm_manager.offline.run_files import Run, errors_of, position_error, write_run, write_summary, write_trajectory
from mlsm_manager.offline.trust import KnownPlaces, Trust
from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.self_check.causes import NOTHING_ASSUMED, Assumption, Cause
from mlsm_manager.self_check.verdict import Answer, RunAnswer, Verdict
from mlsm_manager.surface_map.map_file import Layer, StoredMap, read_map
from node_support.errors import RefusedInput
from node_support.geometry import composed, matrices
from recordings.bags.bag import RecordingError
from recordings.bags.writers import BagWriter
from sonar_processing.beams.beam import Beam, PlacedBeam
from sonar_processing.beams.parameters import BeamCorrection
from sonar_processing.filters.echo_extractor import FEWEST_BEAMS, EchoExtractor, EchoExtractorParameters

TIMES = np.arange(4.0)
ODOMETRY_POSES = np.column_stack([TIMES, np.zeros(4), np.full(4, 4.0)])
TRACK = Track(TIMES, ODOMETRY_POSES)
STORED = StoredMap("map", {Layer.SHOWN: blocks_of([(-2.0, -1.0)])})
RUN = Run(TIMES, {ODOMETRY: ODOMETRY_POSES, CORRECTED: ODOMETRY_POSES + np.array([0, 0.5, 0])}, {}, STORED)
TRUTH = Truth(TIMES, np.column_stack([TIMES, np.zeros(4)]))


def test_the_table_has_time_and_pose_of_every_trajectory(tmp_path):
    write_trajectory(tmp_path / "trajectory.csv", RUN.times, RUN.poses)
    header, first = (tmp_path / "trajectory.csv").read_text().splitlines()[:2]
    assert header == "time,odometry_x,odometry_y,odometry_yaw,corrected_x,corrected_y,corrected_yaw"
    np.testing.assert_allclose(np.array(first.split(","), dtype=float), [0, 0, 0, -2.2832, 0, 0.5, -2.2832])


def test_with_an_origin_the_table_has_latitude_and_longitude_of_the_best_trajectory(tmp_path):
    pytest.importorskip("pyproj", reason="pyproj is not installed")
    origin = Origin(41.2, 3.1)
    write_trajectory(tmp_path / "trajectory.csv", RUN.times, RUN.poses, origin)
    header, *rows = (tmp_path / "trajectory.csv").read_text().splitlines()
    assert header.endswith("corrected_yaw,latitude,longitude")
    table = np.array([row.split(",") for row in rows], dtype=float)
    np.testing.assert_allclose(table[:, -2:], origin.degrees(RUN.best), atol=1e-8)


def test_a_map_on_the_chart_has_a_graticule_in_its_picture(tmp_path):
    pytest.importorskip("pyproj", reason="pyproj is not installed")
    stored = replace(STORED, arrays={STORED_ORIGIN: Origin(41.2, 3.1, 60.0).array})
    write_run(tmp_path, "a bag", replace(RUN, stored=stored), Recording([], 0, TRACK, None))
    picture = matplotlib.image.imread(str(tmp_path / "map.png"))[..., :3]
    assert np.isclose(picture, matplotlib.colors.to_rgb("#5b7fa6"), atol=0.02).all(axis=2).any()
    assert read_map(tmp_path / "map.mlsm").origin == Origin(41.2, 3.1, 60.0)


def test_fixes_in_a_bag_put_a_run_on_the_chart(tmp_path):
    """A fix of after the run, and one of a receiver that has none, do not count."""
    pytest.importorskip("pyproj", reason="pyproj is not installed")
    truth = Origin(41.2, 3.1)
    with BagWriter(tmp_path / "dive.bag") as bag:
        for time, status in ((0, 0), (1, 0), (2, 0), (3, -1), (9, 0)):
            message = bag.make("sensor_msgs/NavSatFix")
            message.header.stamp = bag.time(time * 10**9)
            message.status.status = status
            ((message.latitude, message.longitude),) = truth.degrees([[float(time), 0.0]])
            bag.write("/gps/fix", message, time * 10**9)
    fixes = satellite_fixes(tmp_path / "dive.bag")
    assert [fix.time for fix in fixes] == [0.0, 1.0, 2.0, 9.0]
    found = origin_of_fixes(RUN, fixes, AskedOrigin(None))
    np.testing.assert_allclose(truth.points(found.origin.degrees([[0.0, 0.5]])), [[0.0, 0.0]], atol=0.01)
    assert (found.used, found.outliers) == (3, 0)
    with pytest.raises(RefusedInput, match="1 fixes of satellites, none while the odometry is known"):
        origin_of_fixes(RUN, fixes[-1:], AskedOrigin(None))


def test_map_table_and_picture_are_written(tmp_path):
    write_run(tmp_path / "new", "a bag", RUN, Recording([], 0, TRACK, TRUTH))
    trajectories = {"trajectory.csv", "dead_reckoning.tum", "corrected.tum", "truth.tum"}
    assert {path.name for path in (tmp_path / "new").iterdir()} == {"map.mlsm", "map.ply", "map.png", *trajectories}
    assert len(read_map(tmp_path / "new/map.mlsm")) == 1
    picture = matplotlib.image.imread(str(tmp_path / "new/map.png"))[..., :3]
    for color in ("#999999", "#1f5fa8", "#111111"):
        assert np.isclose(picture, matplotlib.colors.to_rgb(color), atol=0.01).all(axis=2).any(), color


def test_errors_are_told_for_every_trajectory_only_with_a_truth():
    assert errors_of(RUN, Recording([], 0, TRACK, None)) == {}
    found = errors_of(RUN, Recording([], 0, TRACK, TRUTH))
    assert found[ODOMETRY] == {"mean": 0.0, "sd": 0.0, "max": 0.0}
    assert set(found) == {ODOMETRY, CORRECTED}


def test_a_summary_that_cannot_be_written_leaves_the_old_one(tmp_path):
    write_summary(tmp_path, {"scans": 1})
    with pytest.raises(TypeError):
        write_summary(tmp_path, {"scans": object()})
    assert json.loads((tmp_path / "summary.json").read_text()) == {"scans": 1}
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]


FINE = Verdict("depth", 0.5, 1.0, "m")
FIRING = Verdict("width", 2.0, 1.0, "too wide (2 m)", doubtful=np.array([[3.0, 9.0]]))
SHORT = Verdict("length", np.nan, 1.0, "m")
LENGTHS = Assumption("ranges are right", 0.0, 0.05)
_FEW = ", faults show from 7 scans on"


def trust_of(*verdicts, times=(0.0, 10.0, 200.0), matched=7):
    covariances = np.tile(np.diag([9.0, 16.0]), (len(times), 1, 1))
    return Trust(list(verdicts), np.array(times), covariances, matched)


@pytest.mark.parametrize(
    ("verdicts", "matched", "line"),
    [
        ((FINE, FINE), 7, "all 2 checks are fine, nothing contradicts: position within 8.7 m"),
        ((FINE, SHORT), 7, "1 of 2 checks are fine, NOT MEASURED: length; position within 8.7 m if these are fine too"),
        ((SHORT,), 7, "NOT MEASURED: none of 1 checks had enough data; nothing can be said of the position"),
        ((FINE,), 1, f"NOT MEASURED: 1 scan matched{_FEW}; nothing can be said of the position"),
        ((FINE,), 2, f"NOT MEASURED: 2 scans matched{_FEW}; nothing can be said of the position"),
        ((FINE,), 6, f"NOT MEASURED: 6 scans matched{_FEW}; position within 8.7 m if there are none"),
        ((FINE, SHORT, FIRING), 7, "DOUBTFUL: too wide (2 m); at best position within 8.7 m"),
        ((FIRING,), 0, "DOUBTFUL: too wide (2 m); at best position within 8.7 m"),
    ],
)
def test_the_headline_says_fine_only_of_what_was_measured(verdicts, matched, line):
    assert trust_of(*verdicts, matched=matched).line == f"trust: {line}"


@pytest.mark.parametrize(
    ("verdicts", "matched", "answer"),
    [
        ((), 7, RunAnswer.UNMEASURED),
        ((FINE, FINE), 6, RunAnswer.UNMEASURED),
        ((FINE, FINE), 7, RunAnswer.FINE),
        ((FINE, SHORT), 7, RunAnswer.PARTLY),
        ((SHORT, FIRING), 0, RunAnswer.DOUBTFUL),
    ],
)
def test_a_run_is_fine_only_if_all_was_measured_and_what_was_wrong_is_mended(verdicts, matched, answer):
    trust = trust_of(*verdicts, matched=matched)
    mended = Cause("the odometry stepped", 9.0, 5.0, is_mended=True)
    assert trust.answer is replace(trust, causes=[mended]).answer is answer
    assert replace(trust, causes=[replace(mended, is_mended=False)]).answer is RunAnswer.DOUBTFUL


def test_no_check_is_fine_of_a_path_that_was_only_assumed():
    assert [one.assuming("it was turned").answer for one in (FINE, SHORT)] == [Answer.NOT_MEASURED] * 2
    assert FIRING.assuming("it was turned") is FIRING


@pytest.mark.parametrize(
    ("verdicts", "if_so", "line"),
    [
        ((FINE, SHORT), np.nan, "NOT MEASURED: it was turned; nothing can be said of the position"),
        ((SHORT,), 1.0, "NOT MEASURED: it was turned; nothing can be said of the position"),
        ((FINE, SHORT), 5.0, "NOT MEASURED: it was turned; position within 8.7 m if so"),
        ((FINE, SHORT), 1.0, "NOT MEASURED: it was turned; position within 1.7 m if so, within 8.7 m if not"),
        (
            (FIRING,),
            1.0,
            "DOUBTFUL: too wide (2 m); at best position within 1.7 m if it was turned, within 8.7 m if not",
        ),
    ],
)
def test_of_a_path_that_was_only_assumed_is_said_how_well_it_is_known_if_that_is_so(verdicts, if_so, line):
    told = trust_of(*(one.assuming("it was turned") for one in verdicts))
    trust = replace(told, assumed=Assumption("it was turned"), if_so=if_so)
    assert trust.line == f"trust: {line}"
    assert (trust.uncertainty is None) == line.endswith("nothing can be said of the position")


def test_what_no_check_can_tell_is_said_last():
    trust = replace(trust_of(FINE), untold="nothing tells the north")
    assert trust.line.endswith("nothing contradicts: position within 8.7 m; nothing tells the north")


@pytest.mark.parametrize(("gone", "assumed"), [(20.0, NOTHING_ASSUMED), (80.0, LENGTHS)])
def test_lengths_that_nobody_measured_are_told_where_the_position_depends_on_them(gone, assumed):
    trust = trust_of(FINE).assuming(LENGTHS, np.array([[0.0, 0.0], [gone / 2.0, 0.0], [gone, 0.0]]))
    assert trust.assumed == assumed
    assert trust.deviations[-1] > trust_of(FINE).deviations[-1]


@pytest.mark.parametrize(("deviation", "stated"), [(0.5, np.sqrt(1.0 + 4.0)), (3.0, 3.0)])
def test_where_two_paths_are_possible_the_larger_deviation_from_the_one_that_is_shown_is_stated(deviation, stated):
    times = np.array([0.0, 10.0])
    shown = KnownPlaces(times, np.zeros((2, 2)), np.tile(0.5 * deviation**2 * np.eye(2), (2, 1, 1)))
    other = KnownPlaces(times - 5.0, np.array([[0.0, 0.0], [4.0, 0.0]]), np.tile(0.5 * np.eye(2), (2, 1, 1)))
    covariances = shown.or_on(other).covariances
    assert np.sqrt(np.trace(covariances[0])) == pytest.approx(stated)


def test_stretches_are_doubtful_where_a_check_fires():
    assert trust_of(FINE).doubtful.shape == (0, 2)
    np.testing.assert_array_equal(trust_of(FINE, FIRING).doubtful, [[3.0, 9.0]])


def test_what_it_cannot_tell_is_null_in_json():
    told = trust_of(FINE, SHORT).to_mapping()
    assert told["checks"]["length"]["value"] is None
    assert told["deviation_per_minute"] == [5.0, None, None, 5.0]
    assert trust_of(SHORT).uncertainty is None
    assert trust_of(SHORT).to_mapping()["deviation_per_minute"] == [None] * 4
    json.dumps(told, allow_nan=False)


SECONDS = np.arange(0.0, 11.0)
AHEAD = np.column_stack([SECONDS, np.zeros(11)])


@pytest.mark.parametrize(
    ("truth", "error"),
    [
        (Truth(SECONDS, AHEAD + np.array([100.0, -50.0])), (0.0, 0.0, 0.0)),
        (Truth(SECONDS, AHEAD[:, ::-1]), (7.071, 4.472, 14.142)),
        (Truth(np.array([0.0, 2.5, 7.5]), np.array([[0, 0], [2.5, 3], [7.5, 0]])), (1.0, 1.414, 3.0)),
        (Truth(np.array([5.0, 10.0, 20.0]), np.array([[5.0, 0.0], [10.0, 0.0], [99.0, 0.0]])), (0.0, 0.0, 0.0)),
    ],
    ids=["shifted", "turned", "at its own stamps", "goes on beyond the odometry"],
)
def test_the_error_is_the_distance_from_the_truth_if_both_begin_at_one_place(truth, error):
    assert position_error(SECONDS, AHEAD, truth) == dict(zip(("mean", "sd", "max"), error))


def test_a_truth_of_another_time_is_refused():
    with pytest.raises(RecordingError, match="no time in common"):
        position_error(SECONDS, AHEAD, Truth(SECONDS + 100.0, AHEAD))


TURNING = Track(SECONDS, np.column_stack([0.5 * SECONDS, 0.1 * SECONDS, 0.2 * SECONDS]))
T_BASE_SONAR = matrices(np.array([0.3, 0.0, np.pi]))
T_BASE_SONAR[2, 3] = -0.2


def taken(seconds):
    """Return what a sonar ahead of and below base_link hears at a time."""
    beam = Beam(round(seconds * 1e9), "sonar", 0.4, np.arange(5, dtype=np.uint8), 0.1)
    return PlacedBeam(beam, matrices(TURNING.at(seconds)) @ T_BASE_SONAR, True)


@pytest.fixture
def recording():
    return Recording([taken(seconds) for seconds in (1.0, 5.0, 9.5)], 2, TURNING, None)


def test_nothing_wrong_changes_nothing(recording):
    assert recording.corrected(BeamCorrection()) is recording


@pytest.mark.parametrize("delay", [0.75, -0.9])
def test_beams_are_placed_where_the_vehicle_was_at_their_true_time(recording, delay):
    found = recording.corrected(BeamCorrection(sonar_delay=delay)).beams
    for placed, seconds in zip(found, (1.0, 5.0)):
        assert placed.beam.stamp_ns == round((seconds + delay) * 1e9)
        np.testing.assert_allclose(placed.T_target_sonar, taken(seconds + delay).T_target_sonar, atol=1e-12)


def test_ranges_are_scaled_from_the_sonar(recording):
    found = recording.corrected(BeamCorrection(range_scale=0.9))
    assert [placed.beam.range_resolution for placed in found.beams] == pytest.approx([0.09] * 3)
    np.testing.assert_allclose(found.beams[1].T_target_sonar, recording.beams[1].T_target_sonar, atol=1e-12)


def test_beams_beyond_the_odometry_count_as_unplaced(recording):
    found = recording.corrected(BeamCorrection(sonar_delay=1.0))
    assert (len(found.beams), found.unplaced) == (2, 3)


@pytest.mark.parametrize(
    ("lengths", "scans"),
    [
        ((30, 63), [30, 63]),
        ((FEWEST_BEAMS - 1, 63), [63]),
        ((30, 40), [30, 40]),
        ((63, 40), [63, 40]),
        ((63, 20), [63]),
    ],
)
def test_parts_of_turns_are_kept_before_a_change_of_the_range_and_if_long_at_the_end(lengths, scans):
    echo = 200 * (np.arange(100) == 50).astype(np.uint8)
    settings = np.repeat([0.1, 0.2], lengths)
    beams = [Beam(10**8 * n, "sonar", 0.1 * n, echo, resolution) for n, resolution in enumerate(settings, 1)]
    placed = [PlacedBeam(beam, np.eye(4), is_moving=False) for beam in beams]
    still = Recording(placed, 0, Track(SECONDS, np.zeros((11, 3))), truth=None)
    assert [count for _, count in scans_of(still, EchoExtractor(EchoExtractorParameters()))] == scans


def test_a_planar_pose_as_a_matrix_keeps_height_and_level():
    found = matrices(np.array([[1.0, 2.0, np.pi / 2.0], [0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(found[0] @ [3.0, 0.0, 7.0, 1.0], [1.0, 5.0, 7.0, 1.0], atol=1e-12)
    np.testing.assert_array_equal(found[1], np.eye(4))


DAMAGED = 5


@pytest.fixture(scope="module")
def made():
    return tour(10)


def recording_of(made):
    beam = Beam(0, "sonar", 0.0, np.zeros(1, dtype=np.uint8), 1.0)
    mounting = matrices(composed(made.odometry.poses[0], np.append(SONAR_IN_BASE, 0.0))[np.newaxis])[0]
    return Recording([PlacedBeam(beam, mounting, False)], 0, made.odometry, None)


def test_a_scan_without_a_solution_is_left_out_and_counted_and_changes_nothing_else(made):
    rest = [*made.scans[:DAMAGED], *made.scans[DAMAGED + 1 :]]
    damaged = [*made.scans[:DAMAGED], with_wild_odometry(made.scans[DAMAGED]), *made.scans[DAMAGED + 1 :]]
    found, expected = (
        replay(recording_of(made), scans, ReplayParameters(), lambda _: None) for scans in (damaged, rest)
    )
    assert found.refused == {"scans without a solution": 1}
    assert len(found.scans) == len(rest)
    assert np.isfinite(found.corrected).all()
    np.testing.assert_allclose(found.corrected, expected.corrected, rtol=0.0, atol=1e-9)
