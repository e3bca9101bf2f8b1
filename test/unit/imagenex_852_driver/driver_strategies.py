"""Hypothesis strategies that the driver's tests share."""

from hypothesis import strategies as st

from imagenex_852_driver.command import SwitchCommand
from imagenex_852_driver.reply import HEAD_IDS, RANGES, Reply, ReplyKind

commands = st.builds(
    dict,
    head_id=st.sampled_from(HEAD_IDS),
    max_range=st.sampled_from(RANGES),
    reverse=st.booleans(),
    start_gain_db=st.integers(0, 40),
    absorption_centi_db_per_m=st.integers(0, 255).filter(lambda value: value != 253),
    train_angle_deg=st.integers(-70, 70).map(lambda value: 3 * value),
    sector_width_deg=st.integers(0, 120).map(lambda value: 3 * value),
    step_size_deg=st.sampled_from((0, 3, 6)),
    pulse_length_us=st.integers(1, 255).filter(lambda value: value != 253),
    data_points=st.sampled_from((250, 500)),
    switch_delay_ms=st.integers(0, 255).filter(lambda value: value != 253).map(lambda value: 2 * value),
    frequency_khz=st.sampled_from((675, 850)),
    profile=st.booleans(),
).map(lambda values: SwitchCommand(**values))


@st.composite
def replies(draw, kinds=tuple(ReplyKind)):
    """Draw any valid reply; long echo rows are a drawn piece repeated, to keep the examples small."""
    kind = draw(st.sampled_from(kinds))
    piece = draw(st.binary(min_size=1, max_size=20))
    return Reply(
        kind=kind,
        head_id=draw(st.sampled_from(HEAD_IDS)),
        status=draw(st.integers(0, 255)),
        head_position=draw(st.integers(0, 8191)),
        clockwise=draw(st.booleans()),
        max_range=draw(st.sampled_from(RANGES)),
        profile_range_cm=draw(st.integers(0, 16383)),
        echoes=(piece * 500)[: kind.echo_count],
    )


@st.composite
def garbage(draw):
    """Draw noise, pieces of replies and commands, and mixtures of them."""
    pieces = st.one_of(
        st.binary(max_size=40),
        st.sampled_from((b"I", b"IG", b"IGX", b"IMX", b"IPX\x10", b"\xfc", b"\xfe\x44", b"\xfd")),
        replies().map(Reply.encode).flatmap(lambda frame: st.integers(0, len(frame) - 1).map(lambda end: frame[:end])),
        replies().map(Reply.encode).flatmap(lambda frame: st.integers(1, len(frame)).map(lambda start: frame[start:])),
    )
    return b"".join(draw(st.lists(pieces, max_size=4)))


def chunks_of(data, cuts):
    """Cut `data` at the given places (any integers)."""
    places = sorted({0, len(data), *(cut % (len(data) + 1) for cut in cuts)})
    return [data[start:end] for start, end in zip(places, places[1:])]
