"""Messages to bytes and back, and in streams with garbage between them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ping360_driver.messages import (
    MessageError,
    MessageId,
    MessageStream,
    PingMessage,
    frame_length,
    packed,
    packed_nack,
)
from ping360_driver.scan_command import (
    INFORMATION_REQUEST,
    LAST_WITHOUT_AUTO_TRANSMIT,
    PulseSettings,
    ScanCommand,
    beam,
    bin_length,
    firmware_of,
    gradians,
    head_angle,
    longest_pulse_us,
    pulse_us,
    refusal,
    sampling,
)

ranges = st.floats(0.75, 50.0)
counts = st.integers(200, 1200)
speeds = st.floats(1300.0, 1700.0)


def test_a_request_has_the_bytes_that_the_protocol_gives():
    """As a user of the head recorded them (discuss.bluerobotics.com, topic 11410)."""
    assert bytes.fromhex("42520200060000000400a000") == INFORMATION_REQUEST


def test_an_auto_transmit_command_has_the_bytes_that_the_protocol_gives():
    """As the same user recorded it, but for the delay, which is 0 here."""
    pulse = PulseSettings(1, 100, 1040, 700, 1250)
    frame = ScanCommand(pulse, center=250, width=100, step=5).auto_transmit()
    assert frame[:24] == bytes.fromhex("425210002a0a0000 010164001004bc02e204c8002c010500")


def message_of(frame):
    return PingMessage(msg_data=frame)


def test_a_refusal_says_what_was_refused_and_why():
    message = message_of(packed_nack(MessageId.AUTO_TRANSMIT, "num_steps out of range"))
    assert refusal(message) == "the head refused message 2602: num_steps out of range"


@pytest.mark.parametrize(
    ("header", "complaint"),
    [
        ("4252020006000000", None),
        ("4352020006000000", "begins with"),
        ("42520200ffff0000", "message_id = 65535"),
        ("4252030006000000", "payload_length = 3"),
        ("4252ffff fc080000", "payload_length = 65535"),
    ],
)
def test_a_header_that_begins_no_message_is_refused(header, complaint):
    if complaint is None:
        assert frame_length(bytes.fromhex(header)) == 12
        return
    with pytest.raises(MessageError, match=complaint):
        frame_length(bytes.fromhex(header))


def device_data(**changes):
    fields = {"angle": 10, "sample_period": 80, "number_of_samples": 3, "data_length": 3, "data": bytearray(b"abc")}
    return message_of(packed(MessageId.DEVICE_DATA, **{**fields, **changes}))


def test_a_beam_says_how_it_was_made():
    found = beam(device_data(gain_setting=2, transmit_frequency=740))
    assert (found.angle, found.echoes, found.sector) == (10, b"abc", None)
    assert found.pulse == PulseSettings(2, 0, 80, 740, 3)


def test_a_beam_of_a_scan_says_its_sector():
    fields = {"sample_period": 80, "start_angle": 5, "stop_angle": 9, "num_steps": 2, "data_length": 1, "data": b"a"}
    assert beam(message_of(packed(MessageId.AUTO_DEVICE_DATA, **fields))).sector == (5, 9, 2)


@pytest.mark.parametrize("wrong", [{"angle": 400}, {"data_length": 2}, {"sample_period": 0}])
def test_a_beam_that_no_head_sends_is_refused(wrong):
    with pytest.raises(MessageError, match=f"{next(iter(wrong))} = {next(iter(wrong.values()))}"):
        beam(device_data(**wrong))


@pytest.mark.parametrize(
    ("firmware", "can"), [((3, 3, 1), True), ((3, 3, 0), False), ((3, 1, 9), False), ((4, 0, 0), True)]
)
def test_newer_firmware_scans_by_itself(firmware, can):
    names = ("firmware_version_major", "firmware_version_minor", "firmware_version_patch")
    message = message_of(packed(MessageId.DEVICE_INFORMATION, device_type=2, **dict(zip(names, firmware))))
    assert (firmware_of(message) > LAST_WITHOUT_AUTO_TRANSMIT) is can


@pytest.mark.parametrize(("gradian", "angle"), [(200, 0.0), (300, -math.pi / 2), (100, math.pi / 2), (0, math.pi)])
def test_gradians_count_clockwise_and_200_is_ahead(gradian, angle):
    assert math.remainder(head_angle(gradian) - angle, 2 * math.pi) == pytest.approx(0.0)
    assert math.remainder(head_angle(gradian, inverted=True) + angle, 2 * math.pi) == pytest.approx(0.0)


def test_degrees_become_whole_gradians():
    assert [gradians(degrees) for degrees in (0.0, 0.9, 90.0, -180.0)] == [0, 1, 100, -200]


@given(ranges, counts, speeds)
def test_the_sampled_range_is_the_wanted_one_to_half_a_percent(max_range, wanted, speed):
    samples, period = sampling(max_range, wanted, speed)
    assert samples * bin_length(period, speed) == pytest.approx(max_range, rel=0.007)


@given(ranges, counts, speeds)
def test_sampling_and_pulse_are_what_the_device_allows(max_range, wanted, speed):
    samples, period = sampling(max_range, wanted, speed)
    assert 200 <= samples <= wanted
    assert 80 <= period <= 40000
    assert 5 <= pulse_us(max_range, period, speed) <= longest_pulse_us(period) <= 500


def test_a_short_range_has_fewer_samples_than_were_asked_for():
    assert sampling(1.0, 1200, 1500.0) == (666, 80)


@pytest.mark.parametrize(
    ("max_range", "samples", "pulse"),
    # As in Ping Viewer; and at least two and a half sample periods.
    [(2.0, 1200, 11), (20.0, 1200, 107), (50.0, 1200, 267), (50.0, 200, 500), (10.0, 200, 167)],
)
def test_the_pulse_grows_with_the_range_and_the_sample_period(max_range, samples, pulse):
    _, period = sampling(max_range, samples, 1500.0)
    assert pulse_us(max_range, period, 1500.0) == pulse


def beam_frame(angle=0, data=bytes(range(200))):
    return packed(
        MessageId.DEVICE_DATA, angle=angle, sample_period=80, number_of_samples=len(data), data_length=len(data),
        data=bytearray(data),
    )  # fmt: skip


def angles(found):
    return [one.message.angle for one in found]


def test_a_whole_message_is_found_with_its_offset_from_the_beginning_of_the_stream():
    stream = MessageStream()
    (first,) = stream.feed(b"xyz" + beam_frame(7))
    (second,) = stream.feed(beam_frame(2))
    assert (first.message.angle, first.offset, first.frame) == (7, 3, beam_frame(7))
    assert second.offset == 3 + len(beam_frame(7))


@given(st.lists(st.binary(min_size=1, max_size=50), min_size=1, max_size=4), st.integers(1, 97))
def test_messages_are_found_however_the_stream_is_split_and_whatever_echoes_they_hold(echoes, size):
    stream, sent = MessageStream(), b"".join(beam_frame(index, data) for index, data in enumerate(echoes))
    found = [one for start in range(0, len(sent), size) for one in stream.feed(sent[start : start + size])]
    assert angles(found) == list(range(len(echoes)))
    assert stream.broken == 0


@given(st.binary(max_size=300), st.integers(1, 97))
def test_no_message_is_lost_because_of_bytes_before_it(rubbish, size):
    stream, sent = MessageStream(), rubbish + beam_frame(1) + beam_frame(2)
    found = [one for start in range(0, len(sent), size) for one in stream.feed(sent[start : start + size])]
    assert angles(found)[-2:] == [1, 2]


def with_changed_byte(frame, index):
    spoilt = bytearray(frame)
    spoilt[index] ^= 0x55
    return bytes(spoilt)


@pytest.mark.parametrize(
    ("rubbish", "broken"),
    [
        *((with_changed_byte(beam_frame(1), index), 1) for index in (0, 1, 2, 3, 4, 5, 8, 100, -1, -2)),
        *((beam_frame(1)[:length], 1) for length in (1, 7, 8, 30, 223)),
        (with_changed_byte(beam_frame(1), 100) * 2, 2),
    ],
)
def test_what_is_changed_or_cut_short_is_broken_and_the_next_message_whole(rubbish, broken):
    stream = MessageStream()
    assert angles(stream.feed(rubbish + beam_frame(2))) == [2]
    assert stream.broken == broken


@pytest.mark.parametrize("length", [0, 60])
def test_a_message_of_any_length_is_found(length):
    data = bytes(range(1, length + 1))
    assert angles(MessageStream().feed(packed_nack(MessageId.TRANSDUCER, data.hex()) + beam_frame(3))[1:]) == [3]


def test_a_message_that_never_ends_is_broken_when_it_is_given_up():
    stream = MessageStream()
    assert stream.missing == 1
    stream.feed(beam_frame(1)[:100])
    assert (stream.pending, stream.missing) == (True, len(beam_frame(1)) - 100)
    stream.reset()
    assert (stream.broken, stream.pending) == (1, False)
