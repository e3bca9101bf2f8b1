"""Turns of the head that are cut into parts."""

import numpy as np
from made_posts import heard

from mlsm_manager.joint_solver.run_log import parts_of
from mlsm_manager.scan_matching.scan import Scan

FIRST, SECOND = heard(2)


def test_every_point_is_in_the_part_of_its_time():
    parts = parts_of(SECOND, 3, FIRST.reference_time)
    assert sum(len(part) for part in parts) == len(SECOND)
    assert all(part.times.max() <= part.reference_time for part in parts)
    assert all(later.times.min() > earlier.reference_time for earlier, later in zip(parts, parts[1:]))


def test_parts_last_equally_long_and_end_with_the_turn():
    ends = [part.reference_time for part in parts_of(SECOND, 4, FIRST.reference_time)]
    np.testing.assert_allclose(np.diff(ends), np.diff(ends)[0])
    assert ends[-1] == SECOND.reference_time


def test_a_turn_after_a_silence_is_cut_where_it_was_heard():
    parts = parts_of(SECOND, 3, SECOND.start - 100.0)
    assert min(len(part) for part in parts) > 0.2 * len(SECOND)


def test_one_part_is_the_scan_itself():
    assert parts_of(SECOND, 1, None)[0] is SECOND


def test_a_turn_without_echoes_has_as_many_parts():
    empty = Scan(np.empty((0, 4)), np.empty(0), np.empty(0, dtype=bool), SECOND.track, SECOND.reference_time)
    for newest in (None, FIRST.reference_time):
        parts = parts_of(empty, 3, newest)
        assert len(parts) == 3
        assert np.all(np.diff([part.reference_time for part in parts]) > 0.0)
