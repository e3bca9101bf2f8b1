"""One ping of the 852: the wait for its reply, what the device makes of what comes instead, and one after the other."""

import pytest
from emulated_drivers import EPOCH, IMAGENEX_852, VirtualScan, running, served

from imagenex_852_driver.command import SwitchCommand
from imagenex_852_driver.device import ReplyWait, SonarDevice
from imagenex_852_driver.emulated_852 import Emulated852
from imagenex_852_driver.parameters import ConnectionParameters, Direction, HeadSettings
from imagenex_852_driver.reply import ParsedReply, Reply, ReplyKind
from sonar_driver.emulated_head import Transmission
from sonar_driver.port import PortUnavailableError

LONG_RANGE = SwitchCommand(max_range=30)
WAITING = ConnectionParameters(reply_margin=0.25, byte_gap=0.1)
START = 100.0
BEGINS = START + 27 * 10 / 115200 + 2 * 30 / 1500
REPLY = Reply(ReplyKind.IGX, 30, bytes(500))
COMMAND = SwitchCommand(max_range=50)


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


@pytest.mark.parametrize(
    ("received", "pending", "goes_on_at", "over_at"),
    [(0, False, 0.24, 0.26), (100, True, 0.10, 0.12), (513, False, None, 0.01)],
    ids=["silence longer than the margin", "gap within a reply", "enough bytes without a reply"],
)
def test_the_wait_ends_when_no_reply_can_come_any_more(wait, received, pending, goes_on_at, over_at):
    wait.take(bytes(received), [], BEGINS + 0.01)
    assert goes_on_at is None or not wait.over(BEGINS + goes_on_at, pending)
    assert wait.over(BEGINS + over_at, pending)
    assert wait.answer_bytes == received


def test_noise_without_end_does_not_hold_the_wait_for_ever(wait):
    for hundredths in range(100):
        wait.take(b"I", [], BEGINS + hundredths / 100)
    assert wait.over(BEGINS + 1.0, pending=True)


@pytest.mark.parametrize("received", [0, 100, 512])
def test_the_missing_bytes_are_those_of_a_whole_reply(wait, received):
    wait.take(bytes(received), [], BEGINS + 0.01)
    assert wait.missing_bytes == 513 - received


@pytest.fixture
def device():
    """Return a device in virtual time on a head."""
    return VirtualScan(IMAGENEX_852).device


def test_a_ping_brings_the_reply_to_its_command_and_leaves_when_its_last_byte_has(device):
    ping = device.ping(COMMAND)
    assert (ping.command, ping.reply.kind, ping.reply.max_range) == (COMMAND, ReplyKind.IGX, 50)
    assert ping.stamp == pytest.approx(EPOCH + 27 * 10 / 1152000)
    assert device.stats.replies == 1


class FixedReplyHead(Emulated852):
    """Answers every command with one reply, whatever was asked."""

    def _ping(self, command, time, overrun):
        return Reply(ReplyKind.IGX, 50, bytes(500))


@pytest.mark.parametrize(
    ("asked", "complaint"),
    [
        (SwitchCommand(max_range=20), "range 50 instead of 20"),
        (SwitchCommand(max_range=50, head_id=0x12), "head identification 16 instead of 18"),
    ],
)
def test_an_answer_to_another_question_is_a_bad_frame(asked, complaint):
    device = VirtualScan(IMAGENEX_852, head=FixedReplyHead, told={"head_id": asked.head_id}).device
    assert device.ping(asked) is None
    assert complaint in device.stats.last_error


def test_a_port_that_goes_away_is_reported_and_closed(tmp_path):
    with served(IMAGENEX_852, tmp_path / "sonar") as (server, connection):
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


def test_a_device_that_only_echoes_gives_bad_frames():
    device = SonarDevice(ConnectionParameters(port="loop://", reply_margin=0.05, byte_gap=0.02))
    device.open()
    assert device.ping(SwitchCommand(max_range=5)) is None
    assert device.stats.replies == 0
    device.close()


def test_replies_before_sound_can_have_returned_are_dropped_and_counted_on_their_own():
    scan = VirtualScan(IMAGENEX_852, told={"speed_of_sound": 2000.0}, baud_rate=115200, speed_of_sound=1400.0)
    assert [scan.device.ping(COMMAND) for _ in range(5)] == [None] * 5
    assert (scan.stats.early_replies, scan.stats.unexpected_replies, scan.stats.timeouts) == (5, 0, 5)


class EchoingLine(Emulated852):
    """A head on two wires whose adapter hears what it sends."""

    def receive(self, data, time):
        return [Transmission(time, data), *super().receive(data, time)]


@pytest.mark.parametrize("head", [Emulated852, EchoingLine])
def test_pings_come_one_after_the_other_also_where_an_adapter_echoes_the_command(head):
    scan = VirtualScan(IMAGENEX_852, head=head)
    scan.beams(5)
    assert positions(scan.pings) == [1400, 1420, 1440, 1460, 1480]
    assert (scan.stats.replies, scan.stats.bad_frames, scan.stats.unexpected_replies) == (5, 0, 0)


def positions(pings):
    return [ping.reply.head_position for ping in pings]


def test_new_settings_take_effect_at_the_next_ping():
    scan = VirtualScan(IMAGENEX_852)
    scan.beams(2)
    scan.settings = HeadSettings(max_range=20, data_points=250, direction=Direction.COUNTERCLOCKWISE)
    scan.beams(2)
    assert [ping.reply.max_range for ping in scan.pings] == [50, 50, 20, 20]
    assert [ping.reply.kind.name for ping in scan.pings] == ["IGX", "IGX", "IMX", "IMX"]
    assert positions(scan.pings) == [1400, 1420, 1440, 1420]


def test_the_scan_goes_on_after_the_head_rebooted(tmp_path):
    sector = HeadSettings(max_range=50, train_angle_deg=30, sector_width_deg=6)
    with running(IMAGENEX_852, tmp_path / "sonar", sector) as (scan, server):
        assert scan.wait_for_more(15)
        before = len(scan.pings)
        server.head.reboot()
        assert scan.wait_for_more(20)
    assert 1400 in positions(scan.pings[before:])
    assert set(positions(scan.pings[-4:])) == {1580, 1600, 1620}
