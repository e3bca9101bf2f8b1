import pytest

from imagenex_852_driver.log_file import timed
from imagenex_852_driver.log_record import LoggedPing
from imagenex_852_driver.protocol.reply import Reply, ReplyKind

REPLY = Reply(ReplyKind.IPX, 20, b"")


def times(stamps, rate=None):
    return [time for time, _ in timed([LoggedPing(REPLY, stamp=stamp) for stamp in stamps], rate)]


def test_pings_keep_the_intervals_of_their_stamps():
    assert times([100.0, 100.5, 102.0]) == [0.0, 0.5, 2.0]


def test_pings_without_stamps_follow_each_other_ten_times_a_second():
    assert times([None, None, None]) == pytest.approx([0.0, 0.1, 0.2])


def test_a_ping_without_a_stamp_among_others_takes_a_usual_interval():
    assert times([100.0, None, 107.0]) == pytest.approx([0.0, 0.1, 0.2])


def test_a_rate_overrides_the_stamps():
    assert times([100.0, 107.0], rate=4.0) == [0.0, 0.25]


def test_time_never_goes_back():
    assert times([100.0, 50.0, 51.0]) == [0.0, 0.0, 1.0]


def test_an_empty_log_has_no_times():
    assert times([]) == []
