"""Each check fires where it should, and not where it must not."""

import numpy as np
import pytest

from mlsm_manager.self_check.map_checks import recent_agreement, surfaces_tell
from mlsm_manager.self_check.path_checks import (
    against_odometry,
    as_expected,
    halves_agree,
    per_minute,
    settings_agree,
    starts_agree,
    told_deviation,
)
from mlsm_manager.self_check.verdict import Verdict, merged

TIMES = np.arange(0.0, 2000.0, 1.0)
STRAIGHT = np.column_stack([0.25 * TIMES, np.zeros(len(TIMES))])


def test_a_path_like_the_odometry_s_is_trusted():
    turned = np.column_stack([STRAIGHT[:, 0] * np.cos(0.1), STRAIGHT[:, 0] * np.sin(0.1)])
    along, across = against_odometry(TIMES, STRAIGHT, 1.01 * turned)
    assert not along.fires
    assert not across.fires
    assert not len(along.doubtful)


def test_a_path_that_is_dragged_along_a_canal_is_doubted_there():
    dragged = STRAIGHT.copy()
    dragged[1000:1600, 0] = 250.0 + 0.7 * 0.25 * np.arange(600.0)
    dragged[1600:, 0] = dragged[1599, 0] + 0.25 * np.arange(1.0, 401.0)
    along, _ = against_odometry(TIMES, STRAIGHT, dragged)
    assert along.fires
    assert along.doubtful[0, 0] < 1000.0 < along.doubtful[0, 1]
    assert along.doubtful[-1, 1] < 1999.0


def test_a_path_that_bends_away_is_doubted():
    angle = np.where(TIMES < 1000.0, 0.0, 0.6)
    bent = np.cumsum(0.25 * np.column_stack([np.cos(angle), np.sin(angle)]), axis=0)
    assert against_odometry(TIMES, STRAIGHT, bent)[1].fires


def test_a_vehicle_that_stays_says_nothing_about_distances():
    along, across = against_odometry(TIMES, 0.0 * STRAIGHT, 0.0 * STRAIGHT)
    assert not along.fires
    assert "too little" in across.line()


@pytest.mark.parametrize(("lost_from", "fires"), [(100, False), (92, False), (70, True)])
def test_scans_that_left_their_map_are_told(lost_from, fires):
    agreements = np.where(np.arange(100) < lost_from, 0.9, 0.1)
    verdict = recent_agreement(14.0 * np.arange(100), agreements)
    assert verdict.fires == fires
    assert len(verdict.doubtful) == fires


def test_a_head_that_is_mounted_turned_is_told():
    names, expected, deviations = ["sonar_delay", "odometry_direction"], np.zeros(2), np.array([1.0, 0.1])
    assert not as_expected(names, expected, deviations, np.array([0.9, -0.11])).fires
    verdict = as_expected(names, expected, deviations, np.array([0.9, 0.34]))
    assert verdict.fires
    assert "odometry_direction is 0.34, 0 +- 0.1 was expected" in verdict.line()


def test_halves_that_find_another_delay_are_told():
    names, deviations = ["range_scale", "sonar_delay"], np.array([0.01, 0.05])
    assert not halves_agree(names, np.array([0.01, 0.8]), deviations, np.array([-0.01, 0.9]), deviations).fires
    verdict = halves_agree(names, np.array([0.01, 0.8]), deviations, np.array([-0.01, 0.2]), deviations)
    assert verdict.fires
    assert "sonar_delay" in verdict.line()


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


def test_a_deviation_that_grows_without_end_is_told():
    assert not told_deviation(TIMES, np.full(len(TIMES), 2.0)).fires
    assert told_deviation(TIMES, TIMES * 0.01).fires


def test_deviations_are_told_per_minute():
    np.testing.assert_allclose(
        per_minute(np.array([0.0, 30.0, 61.0, 130.0]), np.array([1.0, 3.0, 5.0, 7.0])), [2, 5, 7]
    )


def test_windows_that_overlap_make_one_stretch():
    np.testing.assert_array_equal(merged(np.array([0.0, 5.0, 40.0]), 10.0), [[0.0, 15.0], [40.0, 50.0]])
    assert merged(np.empty(0), 10.0).shape == (0, 2)


def test_a_verdict_says_figure_and_limit():
    assert Verdict("depth", 2.0, 1.0, "m").line() == "depth: DOUBTFUL, 2.00, must be at most 1 (m)"
    assert not Verdict("depth", np.nan, 1.0, "m").fires


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
    assert verdict.fires
    assert "from 420 s into the run on, next to nothing tells the way along" in verdict.line()
    assert 35 <= int(verdict.text.split()[-2]) <= 45
    np.testing.assert_allclose(verdict.doubtful, [[14.0 * 30, 14.0 * 59]])


def test_the_moment_is_told_in_the_run_and_by_the_clock():
    times, surfaces = heard(canal_after(30))
    begin = 1.7e9
    (verdict,) = surfaces_tell(begin, begin + times, surfaces, distance_deviation=np.inf)
    assert "from 420 s into the run (22:20:20 UTC) on" in verdict.line()


def test_corners_tell_the_way():
    assert not surfaces_tell(0.0, *heard(canal_after(60)), distance_deviation=np.inf)[0].fires


def test_scans_that_meet_nothing_tell_nothing():
    assert surfaces_tell(0.0, 14.0 * np.arange(20), np.zeros((20, 2, 2)), distance_deviation=np.inf)[0].fires


def test_a_dvl_tells_the_way_along_a_canal():
    assert surfaces_tell(0.0, *heard(canal_after(0)), distance_deviation=0.01) == ()


def test_few_scans_say_too_little_of_the_surfaces():
    assert "too little" in surfaces_tell(0.0, *heard(canal_after(0)[:9]), distance_deviation=np.inf)[0].line()
