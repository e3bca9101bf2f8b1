import contextlib

import pytest
from driver_strategies import chunks_of, commands, garbage
from hypothesis import given
from hypothesis import strategies as st

from imagenex_852_driver.command import CommandReader, SwitchCommand
from imagenex_852_driver.reply import FrameError, ReplyKind


def test_the_bytes_are_those_of_the_thesis_table():
    command = SwitchCommand(
        max_range=50, reverse=True, start_gain_db=12, absorption_centi_db_per_m=20, train_angle_deg=-30,
        sector_width_deg=90, step_size_deg=6, pulse_length_us=100, data_points=250, switch_delay_ms=10,
        frequency_khz=850,
    )  # fmt: skip
    expected = "fe441032004000000c00143c1e02640000000019000000000501fd"
    assert command.encode() == bytes.fromhex(expected)


@given(commands)
def test_every_valid_command_round_trips_and_has_the_terminator_at_its_end_only(command):
    assert SwitchCommand.decode(command.encode()) == command
    assert command.encode().find(0xFD) == 26


@pytest.mark.parametrize(
    ("field", "value"),
    [("max_range", 25), ("train_angle_deg", 4), ("start_gain_db", 41), ("pulse_length_us", 253), ("data_points", 400)],
)
def test_a_value_the_wire_cannot_carry_is_refused(field, value):
    with pytest.raises(FrameError, match="253" if value == 253 else f"{field} = {value}"):
        SwitchCommand(**{"max_range": 20, field: value})


@pytest.mark.parametrize(
    ("values", "kind"),
    [({"data_points": 250}, ReplyKind.IMX), ({"data_points": 500}, ReplyKind.IGX), ({"profile": True}, ReplyKind.IPX)],
)
def test_the_command_knows_which_reply_it_asks_for(values, kind):
    assert SwitchCommand(max_range=20, **values).reply_kind is kind


@given(st.binary(max_size=60))
def test_decoding_raises_nothing_but_frame_errors(data):
    with contextlib.suppress(FrameError):
        SwitchCommand.decode(data)


@given(st.lists(st.tuples(garbage(), commands), max_size=3), st.lists(st.integers(0), max_size=5))
def test_the_reader_finds_every_command_in_garbage_however_it_is_cut(parts, cuts):
    reader = CommandReader()
    stream = b"".join(noise.replace(b"\xfe", b"") + command.encode() for noise, command in parts)
    found = [command for chunk in chunks_of(stream, cuts) for command in reader.feed(chunk)]
    assert found == [command for _, command in parts]


def test_the_reader_drops_a_command_that_does_not_hold():
    whole = SwitchCommand(max_range=20)
    broken = whole.encode().replace(b"\x14", b"\x07", 1)
    assert CommandReader().feed(broken + whole.encode()) == [whole]
