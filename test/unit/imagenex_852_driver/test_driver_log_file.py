import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from imagenex_852_driver.log_file import LogReader, LogWriteError, LogWriter
from imagenex_852_driver.log_record import LoggedPing
from imagenex_852_driver.protocol.reply import Reply, ReplyKind


def numbered(number):
    return LoggedPing(Reply(ReplyKind.IGX, 50, bytes([number]) * 500), stamp=1000.0 + number)


PINGS = [numbered(number) for number in range(5)]
RECORDS = [ping.encode() for ping in PINGS]


@pytest.fixture
def log(tmp_path):
    return tmp_path / "test.852"


def read_back(path, data):
    path.write_bytes(data)
    reader = LogReader(path)
    return list(reader), reader


def test_every_ping_of_the_real_log_is_read(hydroball):
    reader = LogReader(hydroball)
    seen = {
        (ping.reply.max_range, len(ping.reply.echoes), ping.start_gain_db, ping.reply.head_id, ping.stamp)
        for ping in reader
    }
    assert (reader.ping_count, reader.damage_count) == (177, 0)
    assert seen == {(50, 500, 12, 0x11, None)}


def test_what_was_written_is_read_back(log):
    with LogWriter(log) as writer:
        for ping in PINGS:
            writer.write(ping)
    assert list(LogReader(log)) == PINGS


def test_a_writer_appends_to_what_is_there(log):
    for ping in PINGS:
        with LogWriter(log) as writer:
            writer.write(ping)
    assert list(LogReader(log)) == PINGS


def test_an_empty_log_has_no_pings(log):
    assert read_back(log, b"")[0] == []


def test_garbage_between_pings_is_skipped_and_reported(log):
    pings, reader = read_back(log, RECORDS[0] + b"852\x03garbage" + RECORDS[1])
    assert pings == PINGS[:2]
    assert [(part.offset, part.length) for part in reader.damages] == [(640, 11)]


@pytest.mark.parametrize("length", [1, 50, 99, 100, 300, 612, 613, 630, 639])
def test_a_ping_cut_short_costs_no_other_ping(log, length):
    pings, reader = read_back(log, RECORDS[0] + RECORDS[1][:length] + RECORDS[2])
    assert PINGS[2] in pings
    assert pings[0] == PINGS[0]
    assert reader.damage_count == 1


def test_a_log_that_ends_within_a_ping_is_reported(log):
    pings, reader = read_back(log, RECORDS[0] + RECORDS[1][:200])
    assert pings == PINGS[:1]
    assert "640" in str(reader.damages[0])


def test_a_ping_with_a_broken_reply_is_skipped(log):
    broken = bytearray(RECORDS[1])
    broken[100] = 0
    pings, reader = read_back(log, RECORDS[0] + bytes(broken) + RECORDS[2])
    assert pings == [PINGS[0], PINGS[2]]
    assert (reader.damages[0].offset, reader.damages[0].length) == (640, 640)


def test_only_the_first_hundred_damages_are_remembered_but_all_are_counted(log):
    _, reader = read_back(log, b"".join(b"x" + RECORDS[0] for _ in range(150)))
    assert (reader.damage_count, len(reader.damages), reader.ping_count) == (150, 100, 150)


@given(st.binary(max_size=300), st.integers(0, 639), st.binary(max_size=300))
def test_no_damage_ends_the_reading_or_costs_a_whole_ping(tmp_path_factory, before, cut, after):
    path = tmp_path_factory.mktemp("log") / "damaged.852"
    pings, _ = read_back(path, before + RECORDS[0] + RECORDS[1][:cut] + RECORDS[2] + after)
    assert [ping for ping in pings if ping != PINGS[1]] == [PINGS[0], PINGS[2]]


def test_a_full_disk_leaves_whole_pings_only(log, monkeypatch):
    write = os.write
    with LogWriter(log) as writer:
        writer.write(PINGS[0])
        monkeypatch.setattr(os, "write", lambda file, data: write(file, data[:100]))
        with pytest.raises(LogWriteError, match="100 of 640"):
            writer.write(PINGS[1])
    assert log.read_bytes() == RECORDS[0]


def test_a_log_that_is_not_there_raises_at_once(tmp_path):
    with pytest.raises(FileNotFoundError):
        LogReader(tmp_path / "none.852")
