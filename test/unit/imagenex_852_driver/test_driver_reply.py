import contextlib

import pytest
from driver_strategies import replies
from hypothesis import given
from hypothesis import strategies as st

from imagenex_852_driver.protocol.reply import FrameError, Reply, ReplyKind

RECORDED_HEADER = bytes.fromhex("49475811 45780a32 40037403")


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


def test_a_reply_without_echoes_has_no_range_resolution():
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
