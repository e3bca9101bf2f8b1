"""What a long run took, and whether that is what a mission can afford."""

import re
from collections import Counter
from dataclasses import dataclass
from typing import Dict, Iterator, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from soaking.listening import COUNTED, Listener
from soaking.processes import Held

_SETTLED = 1.0  # h, after which nothing may grow
_MOST_GROWTH = 1.0  # MB/h
_MOST_MEMORY = 400.0  # MB of a process
_MORE_FILES, _MORE_THREADS = 3, 2  # that come and go
_MORE_WAITING = 120  # beams: a scan
_MOST_MATCH_TIME = 100.0  # ms, median
_CORE = "mapping"  # the process whose scans are counted
_MOST_LINES = 60  # of one cause in an hour
_MOST_DISK = 250.0  # MB of logs and saved maps
_FEWEST = 10  # samples that tell a growth
_FAILURE = re.compile(  # a traceback, in the log or alone; what roslaunch says of a node that ended
    r"^(?:.*: )?Traceback \(most recent call last\):\n(?:[ \t].*\n)*.*|^.*process has died.*exit code.*?(?=,)",
    re.MULTILINE,
)
_PLACE = re.compile(r'File "[^"]*", line \d+')


@dataclass(frozen=True)
class Sample:
    """The graph at one time. hours: simulated ones. wall: s. waiting: beams on their way. disk: MB written.

    match_time: ms of the wall clock that the newest scan took the solver.
    """

    hours: float
    wall: float
    held: Dict[str, Held]
    waiting: int
    disk: float
    blocks: int
    scans: int
    match_time: float

    def tell(self, first: "Sample", has_heading: bool = False) -> None:
        """Print it as a line of a table, below a heading."""
        if has_heading:
            columns = f"{'h':>6} {'x real':>6} {'scans':>6} {'ms':>5} {'blocks':>6} {'disk':>6}"
            print(f"{columns}  MB of {', '.join(sorted(self.held))}")
        speed = 3600.0 * (self.hours - first.hours) / max(self.wall - first.wall, 1e-9)
        memory = " ".join(f"{self.held[name].memory:6.1f}" for name in sorted(self.held))
        print(
            f"{self.hours:6.2f} {speed:6.1f} {self.scans:6d} {self.match_time:5.0f} {self.blocks:6d} {self.disk:6.1f}"
            f"  {memory}", flush=True,
        )  # fmt: skip


class JudgedRow(NamedTuple):
    """What was measured, the figure, what is wanted, and whether it holds."""

    what: str
    measured: str
    wanted: str
    holds: bool


def _at_most(what: str, value: float, most: float, unit: str = "", form: str = ".0f") -> JudgedRow:
    return JudgedRow(what, f"{value:{form}}{unit}", f"<= {most:g}{unit}", bool(value <= most))


def rows(samples: Sequence[Sample], listener: Listener, printed: str) -> List[JudgedRow]:
    """Return what the samples of a run, a listener, and what all processes printed tell."""
    settled = [one for one in samples if one.hours >= _SETTLED]
    halves = samples[: len(samples) // 2], samples[len(samples) // 2 :]
    # Below 0 where arrivals were told later than what was sent: none are known to wait.
    waiting = [float(np.median([max(one.waiting, 0) for one in half])) for half in halves]
    return [
        *(row for name in sorted(samples[-1].held) for row in _of_process(name, samples, settled)),
        *_of_scans(settled),
        JudgedRow(
            "beams on their way, first and second half",
            " and ".join(f"{one:.0f}" for one in waiting),
            f"<= {_MORE_WAITING} more",
            waiting[1] - waiting[0] <= _MORE_WAITING,
        ),
        JudgedRow("beams lost on their way", f"{listener.lost}", "0", not listener.lost),
        _at_most("logs and maps on disk", samples[-1].disk, _MOST_DISK, " MB", ".1f"),
        *of_errors(listener.internal_errors(), listener.errors_said, printed),
        *_of_log(listener),
        *_of_diagnostics(listener),
        _of_fixes(listener),
    ]


def _of_process(name: str, samples: Sequence[Sample], settled: Sequence[Sample]) -> Iterator[JudgedRow]:
    yield _at_most(f"{name}: memory", samples[-1].held[name].memory, _MOST_MEMORY, " MB")
    settled = [one for one in settled if name in one.held]
    if len(settled) >= _FEWEST:
        first, last = settled[0].held[name], settled[-1].held[name]
        yield _at_most(f"{name}: growth", _growth(name, settled), _MOST_GROWTH, " MB/h", "+.2f")
        yield _at_most(f"{name}: more files", last.files - first.files, _MORE_FILES, form="+d")
        yield _at_most(f"{name}: more threads", last.threads - first.threads, _MORE_THREADS, form="+d")


def _of_scans(settled: Sequence[Sample]) -> Iterator[JudgedRow]:
    """Yield what a scan cost after the first hour: time of the solver, CPU of its whole way, and memory that stayed."""
    if len(settled) < _FEWEST or _CORE not in settled[0].held:
        return
    first, last = (settled[each] for each in (0, -1))
    scans = max(last.scans - first.scans, 1)
    median = float(np.nanmedian([one.match_time for one in settled]))
    cpu = 1e3 * (last.held[_CORE].cpu - first.held[_CORE].cpu) / scans
    kept = 1e3 * _growth(_CORE, settled) * (last.hours - first.hours) / scans
    yield _at_most(f"solver, a scan, median to scan {last.scans}", median, _MOST_MATCH_TIME, " ms")
    yield JudgedRow(f"{_CORE}: CPU of a scan, beams to map", f"{cpu:.0f} ms", "", True)
    yield JudgedRow(f"{_CORE}: kept of a scan", f"{kept:+.1f} kB", "", True)


def _growth(name: str, samples: Sequence[Sample]) -> float:
    """Return by how much the memory of a process grew, MB/h."""
    return float(np.polyfit([one.hours for one in samples], [one.held[name].memory for one in samples], 1)[0])


def of_errors(counted: Mapping[str, int], said: Sequence[Tuple[str, str]], printed: str) -> Iterator[JudgedRow]:
    """Yield what no run may have: internal errors in /diagnostics, errors in the log, and tracebacks printed.

    counted: by stage. said: node and text. printed: what is not in the log, a thread's traceback for instance, too.
    """
    for stage, count in counted.items():
        yield JudgedRow(f"{stage}: internal errors in /diagnostics", f"{count}", "0", False)
    told: Dict[str, str] = {}
    for node, text in said:
        told.setdefault(_in_short(text), node)
    for one in _FAILURE.findall(printed):
        told.setdefault(_in_short(one), "printed by a process")
    for text, node in told.items():
        yield JudgedRow(f"{node}: error", text, "none", False)


def _in_short(text: str) -> str:
    """Return the place of a traceback and what it says; other text as its last line."""
    return " ".join([*_PLACE.findall(text)[-1:], text.strip().splitlines()[-1]])


def _of_log(listener: Listener) -> Iterator[JudgedRow]:
    """Yield how many lines each cause had in the hour in which it had most."""
    most: Dict[str, int] = {}
    for (line, _), count in Counter((line, int(hours)) for hours, line in listener.lines).items():
        most[line] = max(count, most.get(line, 0))
    for line, count in sorted(most.items(), key=lambda each: -each[1]):
        yield _at_most(f"log lines in an hour: {line[:60]}", count, _MOST_LINES)


def _of_diagnostics(listener: Listener) -> Iterator[JudgedRow]:
    """Yield what nodes count beside what the listener counted, and what they complained of."""
    sent, heard = (listener.value(*each) for each in (("sonar_simulator", "beams out"), ("sonar_to_cloud", "beams in")))
    yield JudgedRow("sonar_to_cloud: beams in", f"{heard}", f"{sent}, as sonar_simulator sent", sent == heard)
    for topic, counters in COUNTED.items():
        heard = listener.counts[topic]
        for stage, counter in counters:
            told = listener.value(stage, counter)
            yield JudgedRow(f"{stage}: {counter}", f"{told}", f"{heard}, as on {topic}", told == heard)
    for text, count in listener.complaints():
        yield JudgedRow(f"/diagnostics: {text[:60]}", f"{count} s", "not more than the log", True)


def _of_fixes(listener: Listener) -> JudgedRow:
    """Return how far fixes were from the truth, and how far they said at most."""
    errors = np.array(listener.errors).reshape(-1, 3)
    if not len(errors):
        return JudgedRow("fixes", "0", "some", False)
    last = errors[errors[:, 0] > errors[-1, 0] - 1.0]
    within = float(np.mean(last[:, 1] <= 3.0 * last[:, 2]))
    figures = f"{last[:, 1].mean():.2f} m, {last[:, 1].max():.2f} m at most; told {last[:, 2].mean():.2f} m"
    return JudgedRow("error of the last hour's fixes", figures, "within three deviations told", within >= 0.95)
