import pytest

from imagenex_852_driver.line.device import ReplyWait
from imagenex_852_driver.line.parameters import ConnectionParameters
from imagenex_852_driver.protocol.command import SwitchCommand
from imagenex_852_driver.protocol.reply import Reply, ReplyKind
from imagenex_852_driver.protocol.reply_parser import ParsedReply

COMMAND = SwitchCommand(max_range=30)
CONNECTION = ConnectionParameters(reply_margin=0.25, byte_gap=0.1)
START = 100.0
BEGINS = START + 27 * 10 / 115200 + 2 * 30 / 1500
REPLY = Reply(ReplyKind.IGX, 30, bytes(500))


@pytest.fixture
def wait():
    return ReplyWait(COMMAND, CONNECTION, START)


def test_a_whole_reply_ends_the_wait(wait):
    wait.take(bytes(513), [ParsedReply(0, REPLY)], BEGINS + 0.05)
    assert wait.over(BEGINS + 0.05, pending=False)
    assert wait.reply == REPLY


def test_a_reply_that_began_before_sound_was_back_answers_another_command(wait):
    wait.take(bytes(64), [], START + 0.01)
    wait.take(bytes(449), [ParsedReply(0, REPLY)], BEGINS)
    assert wait.reply is None
    assert (wait.early_replies, wait.unexpected_replies) == (1, 0)


def test_the_answer_behind_an_early_reply_is_taken(wait):
    wait.take(bytes(64), [], START + 0.01)
    wait.take(bytes(962), [ParsedReply(0, REPLY), ParsedReply(513, REPLY)], BEGINS + 0.05)
    assert wait.reply == REPLY


def test_a_reply_that_was_read_late_because_the_driver_stalled_is_good(wait):
    wait.take(bytes(513), [ParsedReply(0, REPLY)], BEGINS + 5.0)
    assert wait.reply == REPLY


def test_of_two_replies_that_a_stall_heaped_up_the_newer_is_the_answer(wait):
    old = Reply(ReplyKind.IGX, 30, bytes(500), head_position=1380)
    wait.take(bytes(1026), [ParsedReply(0, old), ParsedReply(513, REPLY)], BEGINS + 5.0)
    assert (wait.reply, wait.unexpected_replies) == (REPLY, 1)


def test_silence_ends_the_wait_after_the_margin(wait):
    assert not wait.over(BEGINS + 0.24, pending=False)
    assert wait.over(BEGINS + 0.26, pending=False)
    assert not wait.answered


def test_a_gap_within_a_reply_ends_the_wait(wait):
    wait.take(bytes(100), [], BEGINS + 0.01)
    assert not wait.over(BEGINS + 0.10, pending=True)
    assert wait.over(BEGINS + 0.12, pending=True)
    assert wait.answered


def test_enough_bytes_without_a_reply_end_the_wait_at_once(wait):
    wait.take(bytes(513), [], BEGINS + 0.05)
    assert wait.over(BEGINS + 0.05, pending=False)


def test_noise_without_end_does_not_hold_the_wait_for_ever(wait):
    for hundredths in range(100):
        wait.take(b"I", [], BEGINS + hundredths / 100)
    assert wait.over(BEGINS + 1.0, pending=True)


@pytest.mark.parametrize("received", [0, 100, 512])
def test_the_missing_bytes_are_those_of_a_whole_reply(wait, received):
    wait.take(bytes(received), [], BEGINS + 0.01)
    assert wait.missing_bytes == 513 - received
