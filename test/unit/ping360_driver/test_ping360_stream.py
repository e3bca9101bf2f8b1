import pytest
from hypothesis import given
from hypothesis import strategies as st

from ping360_driver.protocol.messages import MessageId, MessageStream, packed, packed_nack


def beam_frame(angle=0, data=bytes(range(200))):
    return packed(
        MessageId.DEVICE_DATA, angle=angle, sample_period=80, number_of_samples=len(data), data_length=len(data),
        data=bytearray(data),
    )  # fmt: skip


def angles(found):
    return [one.message.angle for one in found]


def test_a_whole_message_is_found():
    (found,) = MessageStream().feed(beam_frame(7))
    assert (found.message.angle, found.offset, found.frame) == (7, 0, beam_frame(7))


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


@pytest.mark.parametrize("index", [0, 1, 2, 3, 4, 5, 8, 100, -1, -2])
def test_a_message_with_a_changed_byte_is_broken_and_the_next_one_whole(index):
    spoilt = bytearray(beam_frame(1))
    spoilt[index] ^= 0x55
    stream = MessageStream()
    assert angles(stream.feed(bytes(spoilt) + beam_frame(2))) == [2]
    assert stream.broken == 1


@pytest.mark.parametrize("length", [1, 7, 8, 30, 223])
def test_a_message_that_was_cut_short_is_broken_and_the_next_one_whole(length):
    stream = MessageStream()
    assert angles(stream.feed(beam_frame(1)[:length] + beam_frame(2))) == [2]
    assert stream.broken == 1


@pytest.mark.parametrize("length", [0, 60])
def test_a_message_of_any_length_is_found(length):
    data = bytes(range(1, length + 1))
    assert angles(MessageStream().feed(packed_nack(MessageId.TRANSDUCER, data.hex()) + beam_frame(3))[1:]) == [3]


def test_two_broken_messages_in_a_row_are_counted_twice():
    spoilt = bytearray(beam_frame(1))
    spoilt[100] ^= 0x55
    stream = MessageStream()
    stream.feed(bytes(spoilt) * 2 + beam_frame(2))
    assert stream.broken == 2


def test_a_message_that_never_ends_is_broken_when_it_is_given_up():
    stream = MessageStream()
    stream.feed(beam_frame(1)[:-1])
    assert stream.pending
    stream.reset()
    assert (stream.broken, stream.pending) == (1, False)


def test_the_stream_tells_how_many_bytes_are_missing():
    stream = MessageStream()
    assert stream.missing == 1
    stream.feed(beam_frame(1)[:100])
    assert stream.missing == len(beam_frame(1)) - 100


def test_offsets_count_from_the_beginning_of_the_stream():
    stream = MessageStream()
    stream.feed(b"xyz" + beam_frame(1))
    assert stream.feed(beam_frame(2))[0].offset == 3 + len(beam_frame(1))
