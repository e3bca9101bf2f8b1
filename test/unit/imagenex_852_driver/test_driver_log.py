"""The manufacturer's logs: records, whole files with damages, and the times of their pings."""

import os

import pytest
from driver_strategies import commands, replies
from hypothesis import given
from hypothesis import strategies as st

from imagenex_852_driver.log_file import (
    LoggedPing,
    LogReader,
    LogWriteError,
    LogWriter,
    check_record_header,
    decode_record,
    timed,
)
from imagenex_852_driver.reply import FrameError, Reply, ReplyKind

REPLY = Reply(ReplyKind.IGX, 50, bytes(range(250)) * 2, head_id=0x11)

pings = st.builds(
    LoggedPing,
    reply=replies(),
    stamp=st.none() | st.integers(0, 4_000_000_000_00).map(lambda hundredths: hundredths / 100),
    clockwise=st.booleans(),
    transducer_up=st.booleans(),
    step_code=st.integers(0, 7),
    start_gain_db=st.integers(0, 40),
    sector_width_deg=st.integers(0, 120).map(lambda value: 3 * value),
    train_angle_deg=st.integers(-70, 70).map(lambda value: 3 * value),
    pulse_length_us=st.integers(0, 255),
    profile=st.integers(0, 4),
    frequency_khz=st.sampled_from((675, 850)),
)


@given(pings)
def test_every_ping_round_trips(ping):
    assert decode_record(ping.encode()) == ping


@pytest.mark.parametrize(("kind", "length"), [(ReplyKind.IPX, 128), (ReplyKind.IMX, 384), (ReplyKind.IGX, 640)])
def test_records_have_the_lengths_of_the_maker(kind, length):
    assert len(LoggedPing(Reply(kind, 20, bytes(kind.echo_count))).encode()) == length


def test_date_and_time_are_written_as_the_maker_does():
    record = LoggedPing(REPLY, stamp=1561626123.25).encode()
    assert record[8:33] == b"27-Jun-2019\x0009:02:03\x00.25\x00"


@pytest.mark.parametrize("text", [b"31-Feb-2019", b"27-Xyz-2019", b"99-Jun-2019", b"27-Jun-0001", b"\xff" * 11])
def test_a_broken_date_leaves_the_ping_readable_and_without_a_stamp(text):
    record = bytearray(LoggedPing(REPLY, stamp=1.0).encode())
    record[8:19] = text
    assert decode_record(bytes(record)) == LoggedPing(REPLY, stamp=None)


@pytest.mark.parametrize("index", [0, 3, 4, 7, 100, 103, 112 + 500])
def test_a_record_that_does_not_hold_together_is_refused(index):
    record = bytearray(LoggedPing(REPLY).encode())
    record[index] ^= 0x80
    with pytest.raises(FrameError):
        decode_record(bytes(record))


def test_a_value_that_does_not_fit_is_refused_with_the_value():
    with pytest.raises(FrameError, match="byte 38 of the log record = 300"):
        LoggedPing(REPLY, start_gain_db=300).encode()


@given(st.binary(max_size=700))
def test_checking_raises_nothing_but_frame_errors(data):
    try:
        check_record_header(data)
    except FrameError:
        return
    assert data[:3] == b"852"


@given(commands, replies(), st.integers(0, 2_000_000_000))
def test_every_ping_of_the_driver_can_be_logged(command, reply, stamp):
    logged = LoggedPing.of(float(stamp), command, reply)
    assert decode_record(logged.encode()) == logged


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


def test_every_ping_of_the_real_log_is_read(recording):
    reader = LogReader(recording("hydroball.852"))
    seen = {
        (ping.reply.max_range, len(ping.reply.echoes), ping.start_gain_db, ping.reply.head_id, ping.stamp)
        for ping in reader
    }
    assert (reader.ping_count, reader.damages) == (177, [])
    assert seen == {(50, 500, 12, 0x11, None)}


def test_a_writer_appends_to_what_is_there(log):
    for ping in PINGS:
        with LogWriter(log) as writer:
            writer.write(ping)
    assert list(LogReader(log)) == PINGS


def spoilt(record, index):
    return record[:index] + bytes([record[index] ^ 0xFF]) + record[index + 1 :]


@pytest.mark.parametrize(
    ("data", "numbers", "damages"),
    [
        (b"", [], []),
        (RECORDS[0] + b"852\x03garbage" + RECORDS[1], [0, 1], [(640, 11)]),
        (RECORDS[0] + RECORDS[1][:200], [0], [(640, 200)]),
        (RECORDS[0] + spoilt(RECORDS[1], 100) + RECORDS[2], [0, 2], [(640, 640)]),
        *((RECORDS[0] + RECORDS[1][:length] + RECORDS[2], [0, 2], [(640, length)]) for length in (1, 50, 300, 612)),
        # Of one that lacks the end of its zero fill only, nothing is lost but that.
        *((RECORDS[0] + RECORDS[1][:length] + RECORDS[2], [0, 1, 2], [(640 + length, 0)]) for length in (613, 639)),
    ],
)
def test_damaged_parts_are_skipped_and_reported(log, data, numbers, damages):
    pings, reader = read_back(log, data)
    assert pings == [PINGS[number] for number in numbers]
    assert [(part.offset, part.length) for part in reader.damages] == damages


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


@pytest.mark.parametrize(
    ("stamps", "rate", "expected"),
    [
        ([100.0, 100.5, 102.0], None, [0.0, 0.5, 2.0]),
        # Ten times a second, as usual.
        ([None, None, None], None, [0.0, 0.1, 0.2]),
        ([100.0, None, 107.0], None, [0.0, 0.1, 0.2]),
        ([100.0, 107.0], 4.0, [0.0, 0.25]),
        # Time never goes back.
        ([100.0, 50.0, 51.0], None, [0.0, 0.0, 1.0]),
        ([], None, []),
    ],
)
def test_pings_follow_each_other_as_their_stamps_or_the_rate_say(stamps, rate, expected):
    pings = [LoggedPing(REPLY, stamp=stamp) for stamp in stamps]
    assert [time for time, _ in timed(pings, rate)] == pytest.approx(expected)
