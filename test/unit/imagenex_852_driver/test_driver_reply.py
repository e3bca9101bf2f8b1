"""Replies to bytes and back, in streams with garbage between them, and the angles in them."""

import contextlib
import math

import pytest
from driver_strategies import chunks_of, garbage, replies
from hypothesis import given
from hypothesis import strategies as st

from imagenex_852_driver.reply import FrameError, Reply, ReplyKind, ReplyParser, head_angle, head_position

RECORDED_HEADER = bytes.fromhex("49475811 45780a32 40037403")
WHOLE = Reply(ReplyKind.IGX, 50, bytes(range(250)) * 2)


@given(replies())
def test_every_valid_reply_round_trips(reply):
    assert Reply.decode(reply.encode()) == reply


@pytest.mark.parametrize(("kind", "length"), [(ReplyKind.IMX, 265), (ReplyKind.IGX, 513), (ReplyKind.IPX, 13)])
def test_replies_have_the_lengths_of_the_thesis(kind, length):
    assert len(Reply(kind, 20, bytes(kind.echo_count)).encode()) == length


def test_a_recorded_header_is_read_field_by_field():
    reply = Reply.decode(RECORDED_HEADER + bytes(500) + b"\xfc")
    assert (reply.kind, reply.head_id, reply.max_range) == (ReplyKind.IGX, 0x11, 50)
    assert (reply.head_position, reply.profile_range_cm) == (1400, 448)
    assert reply.switches_accepted
    assert not reply.overrun


def test_the_range_resolution_is_the_length_of_one_bin():
    assert Reply(ReplyKind.IGX, 50, bytes(500)).range_resolution == pytest.approx(0.1)
    assert Reply(ReplyKind.IPX, 50, b"").range_resolution == 0.0


@pytest.mark.parametrize(("index", "value"), [(0, 0), (3, 0x20), (7, 11), (10, 0), (-1, 0xFD)])
def test_a_broken_byte_is_refused(index, value):
    frame = bytearray(RECORDED_HEADER + bytes(500) + b"\xfc")
    frame[index] = value
    with pytest.raises(FrameError):
        Reply.decode(bytes(frame))


def test_a_wrong_number_of_echoes_is_refused_with_the_number():
    with pytest.raises(FrameError, match="251"):
        Reply(ReplyKind.IMX, 20, bytes(251))


@given(st.binary(max_size=600))
def test_decoding_raises_nothing_but_frame_errors(data):
    with contextlib.suppress(FrameError):
        Reply.decode(data)


def replies_in(parser, chunks):
    return [parsed.reply for chunk in chunks for parsed in parser.feed(chunk)]


@given(garbage(), replies())
def test_a_whole_reply_behind_garbage_is_never_lost(noise, reply):
    assert replies_in(ReplyParser(), [noise + reply.encode()])[-1:] == [reply]


@given(garbage(), replies(), garbage(), st.lists(st.integers(0), max_size=8))
def test_any_cutting_of_the_stream_gives_the_same_replies(before, reply, after, cuts):
    stream = before + reply.encode() + after
    assert replies_in(ReplyParser(), [stream]) == replies_in(ReplyParser(), chunks_of(stream, cuts))


@given(st.lists(replies(), max_size=4))
def test_replies_back_to_back_come_out_in_order(sent):
    stream = b"".join(reply.encode() for reply in sent)
    assert replies_in(ReplyParser(), [bytes([byte]) for byte in stream]) == sent


def test_a_reply_is_held_back_until_its_last_byte():
    parser = ReplyParser()
    frame = WHOLE.encode()
    assert parser.feed(frame[:-1]) == []
    assert parser.pending
    assert parser.feed(frame[-1:])[0].reply == WHOLE


def test_a_reply_cut_short_whose_end_falls_on_a_terminator_does_not_swallow_the_next():
    following = Reply(ReplyKind.IGX, 50, b"\xfc" * 500)
    stream = WHOLE.encode()[:200] + following.encode()
    assert replies_in(ReplyParser(), [stream]) == [following]


def test_a_status_byte_is_not_taken_for_the_terminator_of_a_cut_reply():
    following = Reply(ReplyKind.IGX, 50, bytes(500), status=0xFC)
    stream = WHOLE.encode()[: 513 - 5] + following.encode()
    assert replies_in(ReplyParser(), [stream]) == [following]


def test_a_reply_cut_short_by_silence_is_given_up():
    parser = ReplyParser()
    parser.feed(WHOLE.encode()[:100])
    parser.reset()
    assert not parser.pending


def test_a_reply_with_a_wrong_terminator_is_none():
    assert replies_in(ReplyParser(), [WHOLE.encode()[:-1] + b"\x00"]) == []


def test_the_offset_is_where_the_reply_began_in_the_stream():
    parser = ReplyParser()
    parser.feed(b"abc")
    assert parser.feed(b"de" + WHOLE.encode())[0].offset == 5


@pytest.mark.parametrize(
    ("position", "inverted", "angle"),
    [(1400, False, 0.0), (2000, False, -math.pi / 2), (2000, True, math.pi / 2), (2800, False, head_angle(400))],
)
def test_the_head_counts_clockwise_from_ahead_and_the_angle_counter_clockwise(position, inverted, angle):
    assert head_angle(position, inverted) == pytest.approx(angle)


@given(st.integers(0, 2800))
def test_angles_stay_within_half_a_turn(position):
    assert abs(head_angle(position)) <= math.pi


@given(st.integers(201, 2599), st.booleans())
def test_positions_come_back_from_their_angles(position, inverted):
    assert head_position(head_angle(position, inverted), inverted) == position
