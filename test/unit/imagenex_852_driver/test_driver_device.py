"""One ping: the wait for its reply, and what the device makes of what comes instead."""

import pytest
from driver_line import served
from virtual_line import VirtualLine, VirtualStop, VirtualStopAt, VirtualTime

from imagenex_852_driver.emulated_852 import Emulated852, EmulatorParameters
from imagenex_852_driver.line.device import ReplyWait, SonarDevice
from imagenex_852_driver.line.parameters import ConnectionParameters
from imagenex_852_driver.protocol.command import SwitchCommand
from imagenex_852_driver.protocol.reply import Reply, ReplyKind
from imagenex_852_driver.protocol.reply_parser import ParsedReply
from sonar_driver.emulator.emulated_head import Transmission
from sonar_driver.emulator.faults import Fault, FaultInjector
from sonar_driver.line.port import PortUnavailableError

LONG_RANGE = SwitchCommand(max_range=30)
WAITING = ConnectionParameters(reply_margin=0.25, byte_gap=0.1)
START = 100.0
BEGINS = START + 27 * 10 / 115200 + 2 * 30 / 1500
REPLY = Reply(ReplyKind.IGX, 30, bytes(500))
COMMAND = SwitchCommand(max_range=50)
FAST = ConnectionParameters(
    baud_rate=1152000, speed_of_sound=15000.0, reply_margin=0.1, late_window=0.15, byte_gap=0.06
)  # fmt: skip


@pytest.fixture
def wait():
    return ReplyWait(LONG_RANGE, WAITING, START)


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


class FixedStatusHead(Emulated852):
    """Answers every command with one reply, whatever was asked."""

    def __init__(self, reply):
        super().__init__()
        self._reply = reply

    def _ping(self, command, time, overrun):
        return self._reply


def virtual_device(head, connection, stop=None):
    """Return an open device on a head, in a time that begins at 1000 s."""
    time = stop.time if stop else VirtualTime()
    line = VirtualLine(head, connection.baud_rate, time)
    device = SonarDevice(connection, stop or VirtualStop(time), lambda: 1000.0 + time.now, time.elapsed, line.open)
    device.open()
    return device


@pytest.fixture
def faults():
    return FaultInjector(EmulatorParameters(lateness=0.2, silence_duration=0.3))


@pytest.fixture
def line(faults):
    """Return a device in virtual time, and the faults of its head."""
    return virtual_device(Emulated852(faults=faults, timing=FAST.timing()), FAST), faults


def test_a_ping_brings_the_reply_to_its_command(line):
    ping = line[0].ping(COMMAND)
    assert (ping.command, ping.reply.kind, ping.reply.max_range) == (COMMAND, ReplyKind.IGX, 50)
    assert line[0].stats.replies == 1


def test_the_stamp_is_when_the_last_byte_of_the_command_left(line):
    assert line[0].ping(COMMAND).stamp == pytest.approx(1000.0 + 27 * 10 / 1152000)


def test_the_next_command_may_ask_for_something_else(line):
    line[0].ping(COMMAND)
    assert line[0].ping(SwitchCommand(max_range=20, data_points=250)).reply.kind is ReplyKind.IMX


@pytest.mark.parametrize("fault", [Fault.DROPPED, Fault.LATE, Fault.SILENCE])
def test_a_reply_that_does_not_come_in_time_is_a_timeout(line, fault):
    device, faults = line
    faults.order(fault)
    assert device.ping(COMMAND) is None
    assert (device.stats.timeouts, device.stats.bad_frames) == (1, 0)


def test_a_timeout_is_the_last_error(line):
    device, faults = line
    faults.order(Fault.DROPPED)
    device.ping(COMMAND)
    assert "no reply within" in device.stats.last_error


@pytest.mark.parametrize("fault", [Fault.GARBLED, Fault.TRUNCATED])
def test_a_spoilt_reply_is_a_bad_frame(line, fault):
    device, faults = line
    faults.order(fault)
    assert device.ping(COMMAND) is None
    assert (device.stats.timeouts, device.stats.bad_frames) == (0, 1)
    assert "bad reply" in device.stats.last_error


@pytest.mark.parametrize("fault", [Fault.DROPPED, Fault.LATE, Fault.GARBLED, Fault.TRUNCATED, Fault.DOUBLED])
def test_the_ping_after_a_fault_gets_its_own_reply(line, fault):
    device, faults = line
    faults.order(fault)
    device.ping(COMMAND)
    # Every ping steps by 20 positions, so the position tells which ping was answered.
    assert device.ping(COMMAND).reply.head_position == 1420


@pytest.mark.parametrize("fault", [Fault.LATE, Fault.DOUBLED])
def test_a_reply_that_nobody_waits_for_is_counted(line, fault):
    device, faults = line
    faults.order(fault)
    device.ping(COMMAND)
    device.ping(COMMAND)
    assert device.stats.unexpected_replies == 1


def test_an_overrun_is_counted_and_its_reply_delivered(line):
    device, faults = line
    faults.order(Fault.OVERRUN)
    assert device.ping(COMMAND).reply.overrun
    assert device.stats.overruns == 1


@pytest.mark.parametrize(
    ("asked", "complaint"),
    [
        (SwitchCommand(max_range=20), "range 50 instead of 20"),
        (SwitchCommand(max_range=50, head_id=0x12), "head identification 16 instead of 18"),
    ],
)
def test_an_answer_to_another_question_is_a_bad_frame(line, asked, complaint):
    head = FixedStatusHead(line[0].ping(COMMAND).reply)
    head._head_id = asked.head_id
    device = virtual_device(head, ConnectionParameters())
    assert device.ping(asked) is None
    assert complaint in device.stats.last_error


def test_every_ping_ends_in_exactly_one_count(line):
    device, faults = line
    for fault in (Fault.DROPPED, Fault.GARBLED, Fault.DOUBLED, Fault.NONE):
        faults.order(fault)
    for _ in range(4):
        device.ping(COMMAND)
    stats = device.stats
    assert stats.pings == stats.replies + stats.timeouts + stats.bad_frames + stats.interrupted == 4


def test_a_stop_interrupts_a_ping_at_once(faults):
    stop = VirtualStopAt(VirtualTime(), 0.05)
    device = virtual_device(Emulated852(faults=faults, timing=FAST.timing()), FAST, stop)
    faults.order(Fault.SILENCE)
    assert device.ping(SwitchCommand(max_range=50, switch_delay_ms=510)) is None
    assert stop.time.now < 0.05 + 0.1
    assert device.stats.interrupted == 1


def test_a_port_that_goes_away_is_reported_and_closed(tmp_path):
    with served(tmp_path) as (server, connection):
        device = SonarDevice(connection)
        device.open()
        server.disappear()
        with pytest.raises(PortUnavailableError, match=r"sonar is lost"):
            device.ping(COMMAND)
    assert not device.stats.connected


def test_pinging_without_a_port_is_refused(tmp_path):
    device = SonarDevice(ConnectionParameters(port=str(tmp_path / "none")))
    with pytest.raises(PortUnavailableError, match="not open"):
        device.ping(COMMAND)


def test_a_device_that_only_echoes_gives_bad_frames(tmp_path):
    device = SonarDevice(ConnectionParameters(port="loop://", reply_margin=0.05, byte_gap=0.02))
    device.open()
    assert device.ping(SwitchCommand(max_range=5)) is None
    assert device.stats.replies == 0
    device.close()


def test_replies_before_sound_can_have_returned_are_dropped_and_counted_on_their_own():
    head = Emulated852(timing=ConnectionParameters(speed_of_sound=2000.0).timing())
    device = virtual_device(head, ConnectionParameters(speed_of_sound=1400.0))
    assert [device.ping(SwitchCommand(max_range=50)) for _ in range(5)] == [None] * 5
    stats = device.stats
    assert (stats.early_replies, stats.unexpected_replies, stats.timeouts) == (5, 0, 5)


class EchoingLine(Emulated852):
    """A head on two wires whose adapter hears what it sends."""

    def receive(self, data, time):
        return [Transmission(time, data), *super().receive(data, time)]


def test_an_adapter_that_echoes_the_command_does_no_harm():
    device = virtual_device(EchoingLine(timing=FAST.timing()), FAST)
    replies = [device.ping(COMMAND).reply.head_position for _ in range(3)]
    assert replies == [1400, 1420, 1440]
    assert (device.stats.replies, device.stats.bad_frames, device.stats.unexpected_replies) == (3, 0, 0)
