"""Logs of Ping Viewer: written as it writes them, read back, also damaged."""

import struct

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ping360_driver.messages import MessageId, packed
from ping360_driver.ping_viewer_log import TITLE, NoLogError, PingViewerLog
from recordings.bags.bag import RecordingError
from recordings.makers_logs import is_makers_log, makers_beams
from recordings.motion.vehicle_motion import MotionNames, MotionSource
from recordings.reader import Request, read

TICKS = 400
SAMPLES = 300
PERSIAN, ARABIC = ({ord("0") + digit: zero + digit for digit in range(10)} for zero in (0x06F0, 0x0660))
LISTENING = TICKS * 25e-9 * SAMPLES


def beam_bytes(gradians, kind=MessageId.DEVICE_DATA):
    echoes = bytes([gradians % 256] * SAMPLES)
    return packed(
        kind, mode=1, gain_setting=1, angle=gradians, transmit_duration=32, sample_period=TICKS, transmit_frequency=750,
        number_of_samples=SAMPLES, data_length=SAMPLES, data=echoes,
    )  # fmt: skip


def text_bytes(text):
    return struct.pack(">I", 2 * len(text)) + text.encode("utf-16-be")


def log_bytes(parts):
    """Return a log of a Ping360 (family 1, type 2) as Ping Viewer writes it, of parts (time [s], data)."""
    header = text_bytes(TITLE) + struct.pack(">i", 1) + 5 * text_bytes("") + struct.pack(">ii", 1, 2)
    return header + b"".join(text_bytes(clock(time)) + struct.pack(">I", len(data)) + data for time, data in parts)


def clock(time):
    minutes, milliseconds = divmod(round(time * 1e3), 60_000)
    return f"{minutes // 60 % 24:02d}:{minutes % 60:02d}:{milliseconds // 1000:02d}.{milliseconds % 1000:03d}"


@pytest.fixture
def turn(tmp_path):
    path = tmp_path / "20200103-143114.bin"
    path.write_bytes(log_bytes((5.0 + 0.05 * index, beam_bytes(index)) for index in range(400)))
    return path


def test_a_part_is_read_as_ping_viewer_s_documentation_describes_it():
    """Title, version, five texts, family and type, then time and data."""
    data = b"\0\0\0\x34" + "PingViewer sensor log file".encode("utf-16-be") + b"\0\0\0\x01"
    data += b"\0\0\0\0" * 5 + b"\0\0\0\x01" + b"\0\0\0\x02"
    data += b"\0\0\0\x18" + "01:02:03.456".encode("utf-16-be") + b"\0\0\0\x02" + b"BR"
    (part,) = PingViewerLog(data)
    assert (part.time, part.data) == (pytest.approx(3723.456), b"BR")
    assert log_bytes([(3723.456, b"BR")]) == data


def test_every_beam_is_read_at_the_time_of_its_ping(turn):
    found = makers_beams(turn)
    assert (len(found.beams), found.refused) == (400, 0)
    assert found.stamps_ns * 1e-9 == pytest.approx(5.0 + 0.05 * np.arange(400) - LISTENING)
    beam = found.beams[100]
    assert beam.angle == pytest.approx(np.pi / 2)
    assert beam.range_resolution == pytest.approx(TICKS * 25e-9 * 1500.0 / 2.0)
    assert (beam.intensities == 100).all()


def test_messages_split_over_parts_and_automatic_ones_are_read_too(tmp_path):
    data = beam_bytes(7, MessageId.AUTO_DEVICE_DATA) + beam_bytes(8)
    path = tmp_path / "split.bin"
    path.write_bytes(log_bytes([(1.0, data[:100]), (1.1, data[100:500]), (1.2, data[500:])]))
    angles = [beam.angle for beam in makers_beams(path).beams]
    assert angles == pytest.approx([(200 - 7) * np.pi / 200, (200 - 8) * np.pi / 200])


@pytest.mark.parametrize(
    "text",
    [
        "21:56:10.861",
        "21:56:10.861".translate(PERSIAN),
        "21:56:10\u066b861".translate(ARABIC),
        "21.56.10,861",
        "09:56:10.861 PM",
        "下午9:56:10.861",
        "2021-06-11 21:56:10.861",
        "21:56:10.861 11.06.21",
        "\u200f11/06/2021 9:56:10.861 ب.ظ",
    ],
)
def test_times_are_read_in_the_digits_signs_and_order_of_any_language(text):
    data = log_bytes([]) + text_bytes(text) + struct.pack(">I", 2) + b"BR"
    (part,) = PingViewerLog(data)
    assert (part.time, part.data) == (pytest.approx(78970.861), b"BR")


def test_a_clock_of_twelve_hours_in_an_unknown_language_goes_on_at_noon():
    texts = ("11:59:59.900 qu", "12:00:00.100 qu", "12:59:59.900 qu", "1:00:00.100 qu")
    data = log_bytes([]) + b"".join(text_bytes(text) + struct.pack(">I", 1) + b"B" for text in texts)
    times = np.array([part.time for part in PingViewerLog(data)])
    np.testing.assert_allclose(times - times[0], [0.0, 0.2, 3600.0, 3600.2])


def test_a_log_whose_beginning_is_lost_is_read_from_its_first_whole_part_on(turn, tmp_path):
    path = tmp_path / "rest.bin"
    path.write_bytes(turn.read_bytes()[3001:])
    assert is_makers_log(path)
    assert len(makers_beams(path).beams) == 400 - 9


def test_logs_of_the_first_versions_have_no_header():
    data = log_bytes([(1.0, b"a"), (2.0, b"b")])[len(log_bytes([])) :]
    assert [part.time for part in PingViewerLog(data)] == [1.0, 2.0]


def test_the_head_with_most_beams_is_read_of_several_on_one_line(tmp_path):
    path = tmp_path / "two.bin"
    other = bytearray(beam_bytes(5))
    other[6] = 3  # Number of the sending device, and the checksum that counts it
    other[-2:] = struct.pack("<H", sum(other[:-2]) & 0xFFFF)
    path.write_bytes(log_bytes([(1.0, bytes(other)), (1.2, beam_bytes(6)), (1.3, beam_bytes(7))]))
    found = makers_beams(path)
    assert (len(found.beams), found.refused) == (2, 0)
    assert "1 of device 3: only those of device 0 are used" in found.notes[-1]


def test_an_echo_sounder_beside_the_head_tells_the_distances_below(tmp_path):
    path = tmp_path / "ping1d.bin"
    sure = packed(1212, distance=4000, confidence=90)
    profile = packed(1300, distance=4200, confidence=80, profile_data_length=2, profile_data=b"ab")
    unsure = packed(1212, distance=100, confidence=10)
    path.write_bytes(log_bytes([(1.0, beam_bytes(5)), (1.1, sure), (1.2, unsure), (1.3, profile)]))
    found = makers_beams(path)
    assert found.refused == 0
    np.testing.assert_allclose(found.later(10.0).soundings, [[11.1, 4.0], [11.3, 4.2]])


def test_times_go_on_after_midnight():
    log = PingViewerLog(log_bytes([(86399.0, b"a"), (86401.0, b"b"), (86400.5, b"c")]))
    assert [part.time for part in log] == [86399.0, 86401.0, 86401.0]


def test_times_go_on_where_the_clock_was_set_back():
    log = PingViewerLog(log_bytes([(100.0, b"a"), (80.0, b"b"), (80.5, b"c"), (140.0, b"d")]))
    assert [part.time for part in log] == [100.0, 100.0, 100.5, 160.0]


def test_zeros_at_the_end_of_a_part_are_not_taken_for_the_beginning_of_the_next():
    """As of 12 parts of one real log: the last bytes of a beam without echoes, and its checksum."""
    parts = [(1.0, b"x" * 20 + b"\0\0\0\x3e"), (2.0, b"y" * 30)]
    log = PingViewerLog(log_bytes(parts))
    assert [(part.time, part.data) for part in log] == parts
    assert log.damaged == 0


def test_a_part_is_as_long_as_the_computer_was_busy(tmp_path):
    path = tmp_path / "busy.bin"
    path.write_bytes(
        log_bytes([(1.0, beam_bytes(1)), (9.0, b"".join(map(beam_bytes, range(2, 60)))), (9.1, beam_bytes(60))])
    )
    assert len(makers_beams(path).beams) == 60


def test_it_is_known_by_its_first_bytes(turn, tmp_path):
    other = tmp_path / "other.bin"
    other.write_bytes(b"\0" * 100)
    assert is_makers_log(turn)
    assert not is_makers_log(other)


def test_it_is_read_as_a_recording_of_a_standing_vehicle(turn):
    held = read(turn, Request(motion=MotionNames(declared=MotionSource.STANDING), offset=1e9))
    assert held.recorded.beams[0].stamp_ns == pytest.approx((1e9 + 5.0) * 1e9, abs=1e7)


@pytest.mark.parametrize("length", [None, -30])
def test_a_log_without_beams_is_refused_also_where_its_header_is_cut(tmp_path, length):
    path = tmp_path / "empty.bin"
    path.write_bytes(log_bytes([])[:length])
    with pytest.raises(RecordingError, match="is a beam of a Ping360"):
        makers_beams(path)


@given(st.integers(0, 100), st.binary(max_size=40))
@example(28, b"")  # what is left ends where the length of its data began
def test_what_is_damaged_costs_no_other_part(place, rubbish):
    parts = [(1.0 + index, bytes([index]) * 20) for index in range(5)]
    whole = log_bytes(parts)
    start = len(log_bytes([]))
    length = (len(whole) - start) // 5
    cut = start + 2 * length + place % length
    log = PingViewerLog(whole[:cut] + rubbish + whole[start + 3 * length :])
    found = [(part.time, part.data) for part in log]
    assert {one for one in parts if one[0] != 3.0} <= set(found)


@given(st.binary(max_size=300), st.integers(0, 200))
def test_no_bytes_raise_anything_but_that_it_is_no_log(rubbish, kept):
    try:
        list(PingViewerLog(log_bytes([(1.0, b"x")])[:kept] + rubbish))
    except NoLogError as error:
        assert str(error)  # noqa: PT017
