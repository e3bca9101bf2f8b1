"""The check that tells of scans whose place in the map is not known."""

import numpy as np

from mlsm_manager.self_check.map_checks import in_one_map

TIMES = np.arange(10) * 14.0


def test_a_run_of_one_map_has_no_such_check():
    assert in_one_map(TIMES, np.zeros(10, dtype=bool)) == ()


def test_scans_apart_make_it_fire_and_are_the_doubtful_ones():
    (verdict,) = in_one_map(TIMES, TIMES > 90.0)
    assert verdict.fires
    assert verdict.value == 0.7
    np.testing.assert_allclose(verdict.doubtful, [[84.0, 126.0]])


def test_a_single_scan_apart_is_told():
    (verdict,) = in_one_map(TIMES[:1], np.ones(1, dtype=bool))
    assert verdict.fires
