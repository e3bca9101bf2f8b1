"""Each check fires where it should, and not where it must not."""

import re

import numpy as np
import pytest
from made_recordings import scans_in
from programs import BASIN

from mlsm_manager.offline.recording import read_recording
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.self_check.map_checks import in_submaps, recent_agreement, scans_go_on, surfaces_tell
from mlsm_manager.self_check.north_east_down import ZDownSigns, z_down_signs
from mlsm_manager.self_check.path_checks import (
    against_odometry,
    as_expected,
    halves_agree,
    mount_told,
    per_minute,
    position_uncertainty,
    settings_agree,
    starts_agree,
)
from mlsm_manager.self_check.verdict import Verdict, merged
from node_support.geometry import inverse, transformed
from recordings.motion.vehicle_motion import MotionNames
from recordings.reader import Request

TIMES = np.arange(0.0, 2000.0, 1.0)
TURN_SECONDS = 14.0
TURNS = np.arange(10) * TURN_SECONDS
STRAIGHT = np.column_stack([0.25 * TIMES, np.zeros(len(TIMES))])


def test_a_path_like_the_odometry_s_is_trusted():
    turned = STRAIGHT[:, :1] * [np.cos(0.1), np.sin(0.1)]
    assert not any(one.fires or len(one.doubtful) for one in against_odometry(TIMES, STRAIGHT, 1.01 * turned))


def test_a_path_that_is_dragged_along_a_canal_is_doubted_there():
    dragged = STRAIGHT.copy()
    dragged[1000:1600, 0] = 250.0 + 0.7 * 0.25 * np.arange(600.0)
    dragged[1600:, 0] = dragged[1599, 0] + 0.25 * np.arange(1.0, 401.0)
    along, _ = against_odometry(TIMES, STRAIGHT, dragged)
    assert along.line().startswith("DOUBTFUL: the corrected path is 30 % shorter than the odometry says")
    assert along.doubtful[0, 0] < 1000.0 < along.doubtful[0, 1]
    assert along.doubtful[-1, 1] < 1999.0


def test_a_path_that_bends_away_is_doubted():
    angle = np.where(TIMES < 1000.0, 0.0, 0.6)
    bent = np.cumsum(0.25 * np.column_stack([np.cos(angle), np.sin(angle)]), axis=0)
    _, across = against_odometry(TIMES, STRAIGHT, bent)
    assert re.match(r"DOUBTFUL: the corrected path is turned by \d+ deg against the odometry", across.line())


def test_a_vehicle_that_stays_says_nothing_about_distances():
    assert all("not measured" in one.line() for one in against_odometry(TIMES, 0.0 * STRAIGHT, 0.0 * STRAIGHT))


@pytest.mark.parametrize(("lost_from", "fires"), [(100, False), (92, False), (70, True)])
def test_scans_that_left_their_map_are_told(lost_from, fires):
    agreements = np.where(np.arange(100) < lost_from, 0.9, 0.1)
    verdict = recent_agreement(14.0 * np.arange(100), agreements)
    assert verdict.line().startswith(
        f"{'DOUBTFUL: the newest scans do not' if fires else 'fine: the newest scans'} lie"
    )
    assert len(verdict.doubtful) == fires


def test_a_head_that_is_mounted_turned_is_told():
    names, expected, deviations = ["sonar_delay", "odometry_direction"], np.zeros(2), np.array([1.0, 0.1])
    assert not as_expected(names, expected, deviations, np.array([0.9, -0.11])).fires
    verdict = as_expected(names, expected, deviations, np.array([0.9, 0.34]))
    assert verdict.line() == (
        "DOUBTFUL: odometry_direction 0.34 is unlikely for such a device and mounting "
        "(expected 0 +- 0.1, 3.4 standard deviations away, limit 3)"
    )


def test_halves_that_find_another_delay_are_told():
    names, deviations = ["range_scale", "sonar_delay"], np.array([0.01, 0.05])
    assert not halves_agree(names, np.array([0.01, 0.8]), deviations, np.array([-0.01, 0.9]), deviations).fires
    verdict = halves_agree(names, np.array([0.01, 0.8]), deviations, np.array([-0.01, 0.2]), deviations)
    assert verdict.line().startswith(
        "DOUBTFUL: the halves of the run disagree on sonar_delay (0.8 and 0.2, 8.5 standard"
    )


def test_settings_that_lead_elsewhere_are_told():
    deviations = np.full(len(TIMES), 0.5)
    near, far = STRAIGHT + 0.3, STRAIGHT + np.column_stack([TIMES * 0.0, np.where(TIMES > 1500.0, 9.0, 0.0)])
    assert not settings_agree(TIMES, np.stack([STRAIGHT, near]), deviations).fires
    verdict = settings_agree(TIMES, np.stack([STRAIGHT, near, far]), deviations)
    assert verdict.fires
    assert verdict.doubtful[0, 0] == 1501.0


def test_a_start_that_is_hardly_left_is_told():
    start = STRAIGHT + 1.0
    assert not starts_agree(TIMES, STRAIGHT, start, STRAIGHT + 0.1).fires
    stuck = starts_agree(TIMES, STRAIGHT, start, np.where(TIMES[:, np.newaxis] > 700.0, start, STRAIGHT))
    assert stuck.fires
    assert stuck.doubtful[0, 0] == 701.0


def test_a_deviation_that_grows_beyond_what_compass_and_lengths_explain_is_told():
    """Far from the start, no position is known better than the heading times the distance."""
    explained = TIMES * 0.01
    assert not position_uncertainty(TIMES, np.hypot(explained, 2.0), explained).fires
    assert position_uncertainty(TIMES, np.hypot(explained, 6.0), explained).fires
    meaning = "position uncertainty reaches 20.0 m (start, compass and lengths explain 0.0 m, limit 5 m more)"
    assert position_uncertainty(TIMES, explained, 0.0 * TIMES).line() == f"DOUBTFUL: {meaning}"


def test_the_direction_of_the_sonar_is_not_measured_where_no_course_tells_it():
    line = "not measured: no usual course tells how the sonar is turned; 6 deg are in the stated deviations"
    assert [one.line() for one in mount_told(np.radians(6.2))] == [line]
    assert mount_told(0.0) == ()


def test_deviations_are_told_per_minute():
    np.testing.assert_allclose(per_minute(np.array([0.0, 30, 61, 130]), np.array([1.0, 3, 5, 7])), [2, 5, 7])


def test_windows_that_overlap_make_one_stretch():
    np.testing.assert_array_equal(merged(np.array([0.0, 5.0, 40.0]), 10.0), [[0.0, 15.0], [40.0, 50.0]])
    assert merged(np.empty(0), 10.0).shape == (0, 2)


@pytest.mark.parametrize(
    ("value", "line"), [(2.0, "DOUBTFUL: deep"), (0.5, "fine: deep"), (np.nan, "not measured: deep")]
)
def test_a_verdict_says_first_whether_it_is_to_be_trusted(value, line):
    verdict = Verdict("depth", value, 1.0, "deep")
    assert verdict.line() == line
    assert verdict.fires == line.startswith("DOUBTFUL")


def heard(angles):
    """Return times and surfaces of scans that each met two surfaces, with normals at `angles` (n, 2) [rad]."""
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return 14.0 * np.arange(len(angles)), np.einsum("nka,nkb->nab", normals, normals)


def canal_after(scans):
    """Return the normals' angles of 60 scans: first a corner, then the walls of a canal along 40 degrees."""
    walls = np.radians(np.array([130.0, -50.0])) + np.random.RandomState(0).normal(0.0, 0.1, (60, 2))
    return np.where((np.arange(60) < scans)[:, np.newaxis], np.radians([0.0, 90.0]), walls)


def test_a_canal_that_does_not_tell_the_way_along_it_is_told():
    (verdict,) = surfaces_tell(0.0, *heard(canal_after(30)), distance_deviation=np.inf)
    said = re.match(r"DOUBTFUL: position along (\d+) deg unknown since 420 s: all walls are parallel", verdict.line())
    assert 35 <= int(said.group(1)) <= 45
    np.testing.assert_allclose(verdict.doubtful, [[14.0 * 30, 14.0 * 59]])


def test_the_moment_is_told_in_the_run_and_by_the_clock():
    times, surfaces = heard(canal_after(30))
    begin = 1.7e9
    (verdict,) = surfaces_tell(begin, begin + times, surfaces, distance_deviation=np.inf)
    assert "since 420 s (22:20:20 UTC)" in verdict.line()


@pytest.mark.parametrize(
    ("scans", "line"),
    [
        (heard(canal_after(60)), "fine: walls tell the position in all directions"),
        ((14.0 * np.arange(20), np.zeros((20, 2, 2))), "DOUBTFUL: position unknown since 0 s: no walls were heard"),
    ],
    ids=["corners", "nothing"],
)
def test_corners_tell_the_way_and_scans_that_meet_nothing_do_not(scans, line):
    (verdict,) = surfaces_tell(0.0, *scans, distance_deviation=np.inf)
    assert verdict.line().startswith(line)


def test_a_dvl_tells_the_way_along_a_canal():
    assert surfaces_tell(0.0, *heard(canal_after(0)), distance_deviation=0.01) == ()


def test_scans_in_submaps_that_nobody_can_place_are_the_doubtful_ones():
    assert in_submaps(TURNS, np.zeros(10, dtype=bool)) == ()
    assert in_submaps(TURNS[:1], np.ones(1, dtype=bool))[0].fires
    (verdict,) = in_submaps(TURNS, TURNS > 90.0)
    assert verdict.line().startswith("DOUBTFUL: the place of some scans in the map is unknown since a silence")
    assert verdict.value == 0.7
    np.testing.assert_allclose(verdict.doubtful, [[84.0, 126.0]])


def run_of(lying, share=0.2):
    """Return the verdict on 30 scans of which `lying` (n,) have `share` of their points on those before."""
    shares = np.full(30, 0.9)
    shares[lying] = share
    return scans_go_on(TURN_SECONDS * np.arange(30), shares)


def test_four_scans_of_twenty_beside_the_others_are_no_reason_to_doubt():
    assert not run_of([10, 14, 18, 22], share=0.0).fires


def test_a_third_of_the_scans_beside_the_others_is():
    verdict = run_of(np.arange(10, 19))
    assert verdict.line() == (
        "DOUBTFUL: scans do not fit those before them; a vehicle with a compass that moves sideways needs "
        "--odometry hovering (only 20 % of the echoes on earlier surfaces, at least 65 % needed)"
    )
    assert verdict.doubtful[0, 0] <= 10 * TURN_SECONDS
    assert verdict.doubtful[-1, 1] >= 18 * TURN_SECONDS


def test_the_figure_falls_with_the_shares_of_the_scans_that_fit_worst():
    values = [run_of(np.arange(10, 19), share).value for share in (0.8, 0.6, 0.4)]
    np.testing.assert_allclose(values, [0.8, 0.6, 0.4])


def test_few_scans_say_too_little():
    assert "not measured" in surfaces_tell(0.0, *heard(canal_after(0)[:9]), distance_deviation=np.inf)[0].line()
    assert "not measured" in scans_go_on(TURN_SECONDS * np.arange(10), np.full(10, 0.1)).line()


def test_scans_without_points_are_left_out():
    shares = np.where(np.arange(50) % 2, np.nan, 0.9)
    assert not scans_go_on(TURN_SECONDS * np.arange(50), shares).fires


TURN = 0.4
LEVEL = np.zeros(10)
TURNED_OVER = -1.0


def _scans(count, sign=1.0, turn=TURN, step=(0.0, 0.0)):
    """Return scans of a room of 20 x 12 m by a vehicle that turns and moves from scan to scan.

    sign: 1.0, or TURNED_OVER for an odometry that counts z down.
    """
    rng = np.random.default_rng(0)
    corners = np.array([[10.0, 6.0], [-10.0, 6.0], [-10.0, -6.0], [10.0, -6.0], [10.0, 6.0]])
    share = np.linspace(0.0, 1.0, 80, endpoint=False)[:, np.newaxis]
    walls = np.concatenate([a + share * (b - a) for a, b in zip(corners, corners[1:])]) + np.array([4.0, 1.0])
    scans = []
    for number in range(count):
        pose = number * np.array([*step, turn])
        told = pose * np.array([1.0, sign, sign])
        seen = transformed(inverse(pose), walls) + rng.normal(0.0, 0.05, walls.shape)
        track = Track(np.array([number, number + 1.0]), np.array([told, told]))
        points = np.column_stack([transformed(told, seen), np.zeros(len(seen)), np.full(len(seen), 100.0)])
        scans.append(Scan(points, np.full(len(points), number + 0.5), np.ones(len(points), bool), track, number + 1.0))
    return scans


@pytest.mark.parametrize("step", [(0.0, 0.0), (0.5, 0.3)])
def test_a_yaw_that_turns_against_the_echoes_is_a_suspicion_and_one_that_they_follow_is_none(step):
    assert z_down_signs(LEVEL, _scans(8, step=step)).lines() == []
    (sign,) = z_down_signs(LEVEL, _scans(8, TURNED_OVER, step=step)).lines()
    assert sign == "in 100 % of the scans the echoes fit better with y and yaw reversed"


def test_a_vehicle_that_stands_tells_nothing():
    assert z_down_signs(LEVEL, _scans(8, TURNED_OVER, turn=0.0)).lines() == []


@pytest.mark.parametrize(("heights", "count"), [([0.0, 3.0, 5.0], 1), ([0.0, -3.0, -5.0], 0), ([-5.0, 0.0, -5.0], 1)])
def test_a_vehicle_that_climbs_far_above_its_start_is_a_suspicion(heights, count):
    assert len(z_down_signs(np.array(heights), []).lines()) == count


@pytest.mark.parametrize(("heights", "count"), [([-5.0, 0.0], 0), ([-5.0, 1.5], 0), ([0.0, 2.5], 1), ([3.0, 4.0], 1)])
def test_a_live_vehicle_is_compared_with_the_surface(heights, count):
    signs = ZDownSigns()
    for height in heights:
        signs.take_heights(np.array([height]))
    assert len(signs.lines()) == count


def test_a_live_vehicle_is_suspected_once_enough_turns_speak_against_it():
    signs = ZDownSigns()
    known = []
    for scan in _scans(8, TURNED_OVER):
        signs.take_scan(scan)
        known.append(len(signs.lines()))
    assert known == [0, 0, 0, 0, 0, 1, 1, 1]


@pytest.mark.parametrize(("z_is_down", "count"), [(False, 0), (True, 1)])
def test_a_tour_of_the_basin_turned_over_is_suspected(z_is_down, count):
    recording = read_recording(BASIN, Request(motion=MotionNames(z_is_down=z_is_down)))
    assert len(z_down_signs(LEVEL, scans_in(recording)).lines()) == count


def test_a_run_whose_turns_are_reversed_is_doubted():
    assert not z_down_signs(LEVEL, _scans(8)).turns().fires
    assert z_down_signs(LEVEL, _scans(8, TURNED_OVER)).turns().fires
    assert "not measured" in z_down_signs(LEVEL, _scans(4, TURNED_OVER)).turns().line()
