"""What the emulated head answers, when, with which faults, and how it turns."""

import pytest

from imagenex_852_driver.command import SwitchCommand
from imagenex_852_driver.emulated_852 import Emulated852, EmulatorParameters, HeadRotation
from imagenex_852_driver.reply import ReplyKind, ReplyParser
from sonar_driver.emulated_head import Fault, FaultInjector

COMMAND = SwitchCommand(max_range=30, data_points=500)


def answers(head, command=COMMAND, time=0.0):
    stream = b"".join(piece.data for piece in head.receive(command.encode(), time))
    return [parsed.reply for parsed in ReplyParser().feed(stream)]


class Recorder:
    def __init__(self):
        self.pings = []

    def __call__(self, ping):
        self.pings.append(ping)
        return bytes(ping.bin_count)


@pytest.mark.parametrize(
    ("asked", "kind"),
    [({"data_points": 250}, ReplyKind.IMX), ({"data_points": 500}, ReplyKind.IGX), ({"profile": True}, ReplyKind.IPX)],
)
def test_the_reply_has_the_commanded_range_and_points_and_says_that_it_was_understood(asked, kind):
    reply = answers(Emulated852(), SwitchCommand(max_range=40, **asked))[0]
    assert (reply.max_range, reply.kind) == (40, kind)
    assert (reply.switches_accepted, reply.overrun) == (True, False)


def test_a_command_for_another_head_is_ignored():
    assert answers(Emulated852(EmulatorParameters(head_id=0x11))) == []


def test_a_command_in_pieces_is_answered_when_it_is_whole():
    head = Emulated852()
    frame = COMMAND.encode()
    assert head.receive(frame[:10], 0.0) == []
    assert head.receive(frame[10:], 1.0)[0].time > 1.0


@pytest.mark.parametrize(("max_range", "delay"), [(5, 0), (50, 0), (50, 100)])
def test_the_reply_begins_after_the_farthest_echo_and_the_switch_delay_and_takes_its_time(max_range, delay):
    command = SwitchCommand(max_range=max_range, switch_delay_ms=delay)
    pieces = Emulated852().receive(command.encode(), 10.0)
    begins = 10.0 + 2 * max_range / 1500 + delay / 1000
    assert pieces[0].time == pytest.approx(begins + len(pieces[0].data) * 10 / 115200)
    assert pieces[-1].time == pytest.approx(begins + 513 * 10 / 115200)


def test_the_gain_scales_the_echoes():
    quiet = answers(Emulated852(), SwitchCommand(max_range=10, start_gain_db=10))[0]
    loud = answers(Emulated852(), SwitchCommand(max_range=10, start_gain_db=20))[0]
    assert max(quiet.echoes[50:]) < max(loud.echoes[50:])


def test_the_fixed_pattern_has_its_wall_where_it_says():
    echoes = answers(Emulated852(), SwitchCommand(max_range=10))[0].echoes
    assert (echoes[50:].index(max(echoes[50:])) + 50.5) * 10 / 500 == pytest.approx(4.0, abs=0.02)


def test_the_echo_source_gets_the_angle_counter_clockwise():
    source = Recorder()
    head = Emulated852(echo_source=source)
    answers(head)
    answers(head, time=5.0)
    assert source.pings[1].angle == pytest.approx(-0.05235988)
    assert (source.pings[1].time, source.pings[1].max_range, source.pings[1].bin_count) == (5.0, 30, 500)


def test_a_late_reply_comes_later_by_what_was_ordered():
    late, good = Emulated852(EmulatorParameters(lateness=0.5)), Emulated852()
    late.faults.order(Fault.LATE)
    difference = late.receive(COMMAND.encode(), 0.0)[0].time - good.receive(COMMAND.encode(), 0.0)[0].time
    assert difference == pytest.approx(0.5)


def test_the_same_seed_gives_the_same_faults():
    rates = EmulatorParameters(dropped=0.2, garbled=0.2)
    first, second = FaultInjector(rates, seed=3), FaultInjector(rates, seed=3)
    assert [first.next() for _ in range(50)] == [second.next() for _ in range(50)]


def test_every_fault_happens_about_as_often_as_its_rate():
    faults = FaultInjector(EmulatorParameters(dropped=0.05, doubled=0.1))
    for _ in range(5000):
        faults.next()
    assert faults.counts[Fault.DROPPED] == pytest.approx(250, abs=60)
    assert faults.counts[Fault.DOUBLED] == pytest.approx(500, abs=80)


def positions(command, count, motion=None):
    motion = motion or HeadRotation()
    found = []
    for _ in range(count):
        motion.obey(command)
        found.append((motion.position - 1400) * 0.15)
        motion.step(command)
    return pytest.approx(found)


@pytest.mark.parametrize(
    ("sector", "expected"),
    [
        ({"step_size_deg": 6}, [*range(0, 180, 6), *range(-180, 0, 6), 0, 6]),
        ({"reverse": True}, [0, -3, -6]),
        ({"sector_width_deg": 12}, [0, 3, 6, 3, 0, -3, -6, -3, 0]),
        # From outside of its sector it steps towards it.
        ({"train_angle_deg": 12, "sector_width_deg": 6}, [0, 3, 6, 9, 12, 15, 12, 9]),
        ({"step_size_deg": 0}, [0, 0, 0]),
        ({"train_angle_deg": -6, "sector_width_deg": 0}, [0, -3, -6, -6, -6]),
    ],
    ids=["full turn", "reverse", "sector", "outside", "no step", "fixed beam"],
)
def test_the_head_turns_as_it_is_commanded(sector, expected):
    assert positions(SwitchCommand(max_range=20, **sector), len(expected)) == expected


def test_reverse_turns_a_sector_scan_around_at_once():
    motion = HeadRotation()
    positions(SwitchCommand(max_range=20, sector_width_deg=60), 2, motion)
    reverse = SwitchCommand(max_range=20, sector_width_deg=60, reverse=True)
    assert positions(reverse, 3, motion) == [6, 3, 0]
