"""What the emulated head answers, when, with which faults, and how it turns."""

import pytest

from imagenex_852_driver.emulated_852 import Emulated852, EmulatorParameters, HeadRotation
from imagenex_852_driver.protocol.command import SwitchCommand
from imagenex_852_driver.protocol.reply import ReplyKind
from imagenex_852_driver.protocol.reply_parser import ReplyParser
from node_support.parameters import ParameterError
from sonar_driver.emulator.emulated_head import EchoSource
from sonar_driver.emulator.faults import Fault, FaultInjector

COMMAND = SwitchCommand(max_range=30, data_points=500)


def answers(head, command=COMMAND, time=0.0):
    stream = b"".join(piece.data for piece in head.receive(command.encode(), time))
    return [parsed.reply for parsed in ReplyParser().feed(stream)]


def head_with(fault):
    faults = FaultInjector(EmulatorParameters(lateness=0.5, silence_duration=3.0, absence_duration=4.0))
    faults.order(fault)
    return Emulated852(faults=faults)


class Recorder(EchoSource):
    def __init__(self):
        self.pings = []

    def echoes(self, ping):
        self.pings.append(ping)
        return bytes(ping.bin_count)


@pytest.mark.parametrize(("points", "kind"), [(250, ReplyKind.IMX), (500, ReplyKind.IGX)])
def test_the_reply_has_the_commanded_range_and_points(points, kind):
    reply = answers(Emulated852(), SwitchCommand(max_range=40, data_points=points))[0]
    assert (reply.max_range, reply.kind) == (40, kind)


def test_an_echo_sounder_in_profile_mode_answers_without_echoes():
    assert answers(Emulated852(), SwitchCommand(max_range=40, profile=True))[0].kind is ReplyKind.IPX


def test_the_reply_says_that_the_switches_were_accepted():
    reply = answers(Emulated852())[0]
    assert (reply.switches_accepted, reply.overrun) == (True, False)


def test_the_head_steps_between_pings():
    head = Emulated852()
    assert [answers(head)[0].head_position for _ in range(3)] == [1400, 1420, 1440]


def test_a_rebooted_head_starts_straight_ahead():
    head = Emulated852()
    answers(head)
    head.reboot()
    assert answers(head)[0].head_position == 1400


def test_a_command_for_another_head_is_ignored():
    assert answers(Emulated852(head_id=0x11)) == []


def test_a_command_in_pieces_is_answered_when_it_is_whole():
    head = Emulated852()
    frame = COMMAND.encode()
    assert head.receive(frame[:10], 0.0) == []
    assert head.receive(frame[10:], 1.0)[0].time > 1.0


@pytest.mark.parametrize(("max_range", "delay"), [(5, 0), (50, 0), (50, 100)])
def test_the_reply_begins_after_the_farthest_echo_and_the_switch_delay(max_range, delay):
    command = SwitchCommand(max_range=max_range, switch_delay_ms=delay)
    first = Emulated852().receive(command.encode(), 10.0)[0]
    line = len(first.data) * 10 / 115200
    assert first.time - line - 10.0 == pytest.approx(2 * max_range / 1500 + delay / 1000)


def test_the_reply_takes_the_time_of_its_bytes_on_the_line():
    pieces = Emulated852().receive(COMMAND.encode(), 0.0)
    assert pieces[-1].time == pytest.approx(2 * 30 / 1500 + 513 * 10 / 115200)


def test_the_gain_scales_the_echoes():
    quiet = answers(Emulated852(), SwitchCommand(max_range=10, start_gain_db=10))[0]
    loud = answers(Emulated852(), SwitchCommand(max_range=10, start_gain_db=20))[0]
    assert max(quiet.echoes[50:]) < max(loud.echoes[50:])


def test_the_fixed_pattern_has_its_wall_where_it_says():
    echoes = answers(Emulated852(), SwitchCommand(max_range=10))[0].echoes
    assert (echoes[50:].index(max(echoes[50:])) + 50.5) * 10 / 500 == pytest.approx(4.0, abs=0.02)


def test_the_echo_source_gets_the_angle_counter_clockwise():
    source = Recorder()
    head = Emulated852(source)
    answers(head)
    answers(head, time=5.0)
    assert source.pings[1].angle == pytest.approx(-0.05235988)
    assert (source.pings[1].time, source.pings[1].max_range, source.pings[1].bin_count) == (5.0, 30, 500)


@pytest.mark.parametrize("fault", [Fault.DROPPED, Fault.GARBLED, Fault.TRUNCATED, Fault.SILENCE])
def test_a_faulty_reply_has_no_whole_frame_and_the_next_one_is_good(fault):
    head = head_with(fault)
    assert answers(head) == []
    assert len(answers(head, time=10.0)) == 1


def test_a_doubled_reply_comes_twice():
    first, second = answers(head_with(Fault.DOUBLED))
    assert first == second


def test_a_late_reply_comes_later_by_what_was_ordered():
    late, good = head_with(Fault.LATE), Emulated852()
    difference = late.receive(COMMAND.encode(), 0.0)[0].time - good.receive(COMMAND.encode(), 0.0)[0].time
    assert difference == pytest.approx(0.5)


def test_an_overrun_is_reported_in_the_status():
    assert answers(head_with(Fault.OVERRUN))[0].overrun


def test_a_silent_head_says_nothing_until_the_silence_is_over():
    head = head_with(Fault.SILENCE)
    assert [len(answers(head, time=time)) for time in (0.0, 1.0, 2.9, 3.1)] == [0, 0, 0, 1]


def test_a_disappearance_names_the_time_of_return():
    head = head_with(Fault.DISAPPEARANCE)
    head.receive(COMMAND.encode(), 100.0)
    assert head.absent_until == 104.0


def test_fault_rates_above_one_in_all_are_refused():
    with pytest.raises(ParameterError, match=r"dropped = 0\.6"):
        EmulatorParameters(dropped=0.6, late=0.6)


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


def test_a_full_turn_goes_round_clockwise():
    command = SwitchCommand(max_range=20, step_size_deg=6)
    expected = [*range(0, 180, 6), *range(-180, 0, 6), 0, 6]
    assert positions(command, 62) == expected


def test_reverse_goes_round_counter_clockwise():
    assert positions(SwitchCommand(max_range=20, reverse=True), 3) == [0, -3, -6]


def test_a_sector_is_scanned_to_and_fro():
    command = SwitchCommand(max_range=20, sector_width_deg=12)
    assert positions(command, 9) == [0, 3, 6, 3, 0, -3, -6, -3, 0]


def test_a_head_outside_of_its_sector_steps_towards_it_and_then_scans_it():
    command = SwitchCommand(max_range=20, train_angle_deg=12, sector_width_deg=6)
    assert positions(command, 8) == [0, 3, 6, 9, 12, 15, 12, 9]


def test_reverse_turns_a_sector_scan_around_at_once():
    motion = HeadRotation()
    positions(SwitchCommand(max_range=20, sector_width_deg=60), 2, motion)
    reverse = SwitchCommand(max_range=20, sector_width_deg=60, reverse=True)
    assert positions(reverse, 3, motion) == [6, 3, 0]


def test_without_a_step_the_head_stays():
    assert positions(SwitchCommand(max_range=20, step_size_deg=0), 3) == [0, 0, 0]


def test_a_sector_of_no_width_is_a_fixed_beam_at_the_train_angle():
    command = SwitchCommand(max_range=20, train_angle_deg=-6, sector_width_deg=0)
    assert positions(command, 5) == [0, -3, -6, -6, -6]
