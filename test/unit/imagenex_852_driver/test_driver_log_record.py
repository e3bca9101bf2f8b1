import pytest
from driver_strategies import commands, replies
from hypothesis import given
from hypothesis import strategies as st

from imagenex_852_driver.log_record import LoggedPing, check_record_header, decode_record
from imagenex_852_driver.protocol.reply import FrameError, Reply, ReplyKind

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
    speed_of_sound=st.integers(14000, 16000).map(lambda tenths: tenths / 10),
    text=st.text("abc Ä", max_size=31),
    depth=st.none() | st.integers(0, 32767).map(lambda tenths: tenths / 10),
    heading_deg=st.none() | st.integers(0, 3600).map(lambda tenths: tenths / 10),
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


def test_negative_turns_are_kept():
    assert decode_record(LoggedPing(REPLY, turns=-2.5).encode()).turns == -2.5


def test_a_depth_in_feet_is_read_in_metres():
    record = bytearray(LoggedPing(REPLY, depth=10.0).encode())
    record[82:83] = b"F"
    assert decode_record(bytes(record)).depth == pytest.approx(3.048)


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
