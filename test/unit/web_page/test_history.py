"""A mission of any length fits: the older, the fewer rows are left."""

import struct

import numpy as np

from web_page.messages import Kind
from web_page.scene import History


def _rows(told):
    rows = []
    for chunk in sorted(told):
        kind, columns, count, number = struct.unpack_from("<BBHI", told[chunk])
        assert (kind, number) == (Kind.TRACK, chunk)
        rows.append(np.frombuffer(told[chunk], "<f4", columns * count, 8).reshape(count, columns))
    return np.vstack(rows)


def test_rows_that_follow_too_soon_are_left_out():
    told = {}
    history = History(Kind.TRACK, 1.0, told.__setitem__)
    for time in (0.0, 0.5, 1.0):
        history.take((time, 0.0))
    assert _rows(told)[:, 0].tolist() == [0.0, 1.0]


def test_a_long_mission_stays_whole_and_bounded():
    told = {}
    history = History(Kind.TRACK, 1.0, told.__setitem__)
    for time in range(100_000):
        history.take((float(time), 2.0 * time))
    rows = _rows(told)
    assert len(rows) == len(history) <= 2048
    assert rows[0, 0] < 200.0
    assert rows[-1, 0] > 99_000.0
    assert np.diff(rows[:, 0]).max() <= 2 * np.diff(rows[:, 0]).min()
    np.testing.assert_allclose(rows[:, 1], 2.0 * rows[:, 0])
