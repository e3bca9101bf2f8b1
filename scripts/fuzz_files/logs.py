"""Logs of a Ping360 as operators have them, made by chance of others: stretches, sectors, ranges, languages, losses."""

import json
import struct
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, NamedTuple

import numpy as np

from fuzz_files.mutations import mutated
from ping360_driver.messages import MessageId, MessageStream, packed
from ping360_driver.ping_viewer_log import TITLE, PingViewerLog
from ping360_driver.scan_command import PERIOD_TICKS, SAMPLES, TICK, TURN
from sonar_processing.beams.beam_fields import USUAL_SPEED_OF_SOUND

_FIELDS = ("mode", "gain_setting", "angle", "transmit_duration", "sample_period", "transmit_frequency")
_DIGITS = (0x30, 0x660, 0x6F0, 0x966, 0x9E6, 0xFF10, 0x11136)  # Zeros: Latin, Arabic, Persian, Hindi and others
_CLOCKS = ("{h:02}:{m:02}:{s:02}.{z:03}", "{h:02}.{m:02}.{s:02},{z:03}", "{d:02}:{m:02}:{s:02}.{z:03} {half}",
           "2023-06-11 {h:02}:{m:02}:{s:02}.{z:03}", "\u200f{h:02}:{m:02}:{s:02}\u066b{z:03}")  # fmt: skip
_RANGES = (0.75, 2.0, 5.0, 15.0, 30.0, 50.0, 60.0)  # m
_WANDER = 0.1  # m: as far may the path of a head go that stands


class Ping(NamedTuple):
    """time: s. fields: of its message. echoes: (bins,) uint8."""

    time: float
    fields: Dict[str, int]
    echoes: np.ndarray

    @property
    def bin_length(self) -> float:
        """In metres."""
        return self.fields["sample_period"] * TICK * USUAL_SPEED_OF_SOUND / 2.0

    def heard_to(self, reach: float, bins: int) -> "Ping":
        """Return the ping as with a range [m] in as many bins, or as few as the head allows."""
        ticks = reach / (TICK * USUAL_SPEED_OF_SOUND / 2.0)
        bins = int(np.clip(bins, 1, ticks // PERIOD_TICKS[0]))
        other = self._replace(fields={**self.fields, "sample_period": round(ticks / bins)})
        places = (np.arange(bins) + 0.5) * other.bin_length
        known = (np.arange(len(self.echoes)) + 0.5) * self.bin_length
        return other._replace(echoes=np.interp(places, known, self.echoes, right=0.0).astype(np.uint8))


Pings = List[Ping]


class LogMaker:
    """Makes logs of others; knows of the newest one whether its head stood still."""

    def __init__(self, paths: List[Path]) -> None:
        self._sources = [pings_of(path) for path in paths]
        self._stands = False

    def make(self, rng: np.random.Generator) -> bytes:
        """Return the bytes of a log: of a head that stands in every second, else of a stretch of one that was found."""
        pings = self._sources[rng.integers(len(self._sources))]
        self._stands = bool(rng.integers(2))
        pings = _standing(pings, rng) if self._stands else _stretch(pings, rng)
        for _ in range(rng.integers(4)):
            pings = _CHANGES[rng.integers(len(_CHANGES))](pings, rng)
        data = _written(pings, rng)
        return mutated(data, False, rng) if rng.integers(4) == 0 else data

    def complaints(self, out: Path) -> Iterator[str]:
        """Yield what is wrong with a map in the folder `out`, if there is one."""
        if not (out / "summary.json").is_file():
            return
        summary = json.loads((out / "summary.json").read_text())
        checks = summary["checks"].items()
        untold = [name for name, check in checks if check["answer"] == "fine" and check["value"] is None]
        is_measured = summary["matched"] >= 3 or any(check["answer"] == "DOUBTFUL" for _, check in checks)
        if untold or not (is_measured or "nothing can be said of the position" in summary["trust"]):
            yield f"called fine without a measure: {untold}, {summary['trust']}"
        path = np.genfromtxt(str(out / "trajectory.csv"), delimiter=",", names=True)
        places = np.column_stack([path["corrected_x"], path["corrected_y"]])
        wander = np.hypot(*(places - places[0]).T).max()
        if self._stands and wander > _WANDER:
            yield f"a head that stands wanders by {wander:.2f} m, {summary['odometry']['profile']}"
        if not (out / "map.png").is_file() or not (out / "report.html").is_file():
            yield "no picture or no report"


def pings_of(path: Path) -> Pings:
    """Return the pings of a log."""
    stream, found = MessageStream(), []
    for part in PingViewerLog(path.read_bytes()):
        for one in (parsed.message for parsed in stream.feed(part.data)):
            if one.message_id == MessageId.DEVICE_DATA:
                fields = {name: getattr(one, name) for name in _FIELDS}
                found.append(Ping(part.time, fields, np.frombuffer(bytes(one.data), dtype=np.uint8)))
    return found


def _stretch(pings: Pings, rng: np.random.Generator) -> Pings:
    count = int(rng.choice([1, 8, 40, 150, 400, 1200]))
    first = int(rng.integers(max(len(pings) - count, 0) + 1))
    return pings[first : first + count]


def _standing(pings: Pings, rng: np.random.Generator) -> Pings:
    """Return sweeps of a sector, or turns, that all hear what was heard first in each direction after some moment."""
    heard: Dict[int, Ping] = {}
    for ping in pings[rng.integers(len(pings)) :] + pings:
        heard.setdefault(ping.fields["angle"], ping)
    width = int(rng.choice([6, 12, 40, 100, 200, TURN]))  # Gradians
    start, begin, turns = int(rng.integers(TURN)), pings[0].time, int(rng.choice([1, 2, 3, 6, 12]))
    reach, bins = float(rng.choice(_RANGES)), int(rng.integers(SAMPLES[0], SAMPLES[1] + 1))
    forth = [
        heard[angle % TURN].heard_to(reach, bins) for angle in range(start, start + width) if angle % TURN in heard
    ]
    back = forth if width == TURN else forth[::-1]
    sweeps = [ping for number in range(turns) for ping in (forth, back)[number % 2]]
    return [
        _speckled(ping, rng)._replace(time=begin + 0.08 * number) for number, ping in enumerate(sweeps or pings[:1])
    ]


def _speckled(ping: Ping, rng: np.random.Generator) -> Ping:
    """Return the ping as it is heard again: each echo a little stronger or weaker, and noise."""
    count = len(ping.echoes)
    echoes = ping.echoes * rng.gamma(30.0, 1.0 / 30.0, count) + rng.exponential(2.0, count)
    return ping._replace(echoes=np.minimum(echoes, 255.0).astype(np.uint8))


def _other_range(pings: Pings, rng: np.random.Generator) -> Pings:
    """Return pings of which, from some moment on, range, number of bins and gain are others."""
    first, reach = rng.integers(len(pings)), float(rng.choice(_RANGES))
    bins, gain = int(rng.integers(SAMPLES[0], SAMPLES[1] + 1)), int(rng.integers(3))
    later = (ping.heard_to(reach, bins) for ping in pings[first:])
    return pings[:first] + [ping._replace(fields={**ping.fields, "gain_setting": gain}) for ping in later]


def _lossy(pings: Pings, rng: np.random.Generator) -> Pings:
    return [ping for ping in pings if rng.uniform() > 0.3] or pings


def _coarser(pings: Pings, rng: np.random.Generator) -> Pings:
    return pings[:: int(rng.choice([2, 5, 10, 20]))]


def _turned(pings: Pings, rng: np.random.Generator) -> Pings:
    """Return pings whose sector may lie across astern, where the head's count begins anew."""
    turn = int(rng.integers(TURN))
    return [ping._replace(fields={**ping.fields, "angle": (ping.fields["angle"] + turn) % TURN}) for ping in pings]


def _other_times(pings: Pings, rng: np.random.Generator) -> Pings:
    """Return pings with a pause of minutes in them, or a clock that was set back."""
    first, seconds = rng.integers(len(pings)), float(rng.choice([-3600.0, -20.0, 3.0, 300.0, 7200.0]))
    return pings[:first] + [ping._replace(time=max(ping.time + seconds, 0.0)) for ping in pings[first:]]


def _silent(pings: Pings, rng: np.random.Generator) -> Pings:
    """Return pings of which some, or all, hear nothing, or are drowned by noise of another sonar."""
    first, loud = rng.integers(len(pings)), int(rng.choice([0, 255]))
    return pings[:first] + [ping._replace(echoes=np.full_like(ping.echoes, loud)) for ping in pings[first:]]


_CHANGES: List[Callable[[Pings, np.random.Generator], Pings]] = [
    _other_range, _other_range, _lossy, _coarser, _turned, _other_times, _silent,
]  # fmt: skip


def _written(pings: Pings, rng: np.random.Generator) -> bytes:
    """Return a log of some version of Ping Viewer in some language, of what came in whole messages or in pieces."""
    zero, clock = int(rng.choice(_DIGITS)), _CLOCKS[rng.integers(len(_CLOCKS))]
    kind = (MessageId.DEVICE_DATA, MessageId.AUTO_DEVICE_DATA)[int(rng.integers(4) == 0)]
    header = _text(TITLE) + struct.pack(">i", 1) + 5 * _text("v2.1.0") + struct.pack(">ii", 1, 2)
    parts = [] if rng.integers(4) == 0 else [header]
    has_sounder, is_split = rng.integers(5) == 0, rng.integers(3) == 0
    for ping in pings:
        data = _message(kind, ping)
        data += packed(1212, distance=4000, confidence=90) if has_sounder else b""
        cut = int(rng.integers(1, len(data))) if is_split else len(data)
        said = _text(_told(ping.time, clock, zero))
        parts += [said + struct.pack(">I", len(piece)) + piece for piece in (data[:cut], data[cut:]) if piece]
    whole = b"".join(parts)
    return whole[: rng.integers(len(whole))] if rng.integers(8) == 0 else whole


def _message(kind: MessageId, ping: Ping) -> bytes:
    fields: Dict[str, Any] = {**ping.fields, "number_of_samples": len(ping.echoes), "data_length": len(ping.echoes)}
    return packed(kind, **fields, data=ping.echoes.tobytes())


def _told(time: float, clock: str, zero: int) -> str:
    seconds, z = divmod(round(time * 1e3), 1000)
    h, m, s = seconds // 3600 % 24, seconds // 60 % 60, seconds % 60
    text = clock.format(h=h, d=(h - 1) % 12 + 1, m=m, s=s, z=z, half="AM" if h < 12 else "PM")
    return text.translate({ord("0") + digit: zero + digit for digit in range(10)})


def _text(text: str) -> bytes:
    data = text.encode("utf-16-be")
    return struct.pack(">I", len(data)) + data
