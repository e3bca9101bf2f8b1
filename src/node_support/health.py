"""Counters, rates and problems of one stage for /diagnostics. Free of ROS and thread-safe."""

import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from typing import Callable, Dict, Iterator

from node_support.timing import UsualInterval

SILENCE = 5.0  # s without a message, from which on a stage says that its input ceased
_MISSING = 15.0  # s without a first message: programs that are started together begin within less
WARNING_PERIOD = 10.0  # s: often enough to be seen in a log, seldom enough to leave the rest of it readable
LONGEST_PERIOD = 60.0  # s: of warnings of what goes on, so that a log of days can be read


class Level(IntEnum):
    """Levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class HealthReport:
    """One stage's state: a level (3, which is no Level, where it is stale), one line, and the counters behind it."""

    level: int
    text: str
    values: Dict[str, str]


class _Input:
    """A topic that is needed. It is silent after some seconds and two of its usual intervals without a message."""

    def __init__(self, now: float, is_expected: bool = False) -> None:
        self._usual = UsualInterval()
        self._newest = now
        self._is_expected = is_expected
        self._next_warning = _MISSING

    def take(self, now: float) -> None:
        self._usual.take(now)
        self._newest, self._is_expected = now, False

    def silence(self, now: float) -> float:
        """Return for how long [s] it has been silent; 0 while it comes as usual, and before it came twice.

        One that is expected from the beginning is silent before, too.
        """
        seconds = now - self._newest
        return seconds if seconds > SILENCE and (self._is_expected or self._usual.overdue(now) > 0.0) else 0.0

    def missed(self, now: float) -> float:
        """Return for how long [s] nothing ever came that is expected, each time that it doubled; 0 in between."""
        seconds = self.silence(now) if self._is_expected else 0.0
        if seconds < self._next_warning:
            return 0.0
        self._next_warning = 2.0 * seconds
        return seconds


class _Problem:
    def __init__(self) -> None:
        self.total = 0
        self.unreported = 0
        self.last_report = float("-inf")
        self.period = WARNING_PERIOD
        self.last_seen = float("-inf")
        self.detail = ""
        self.level = Level.WARN


class Health:
    """Collects what a stage did and what went wrong, and warns once in a while instead of at every message."""

    def __init__(self, name: str, warn: Callable[[str], None], clock: Callable[[], float] = time.monotonic) -> None:
        """`warn` receives one line at most every `WARNING_PERIOD` seconds for each kind of problem.

        Of one that goes on it receives them more and more seldom, until they are `LONGEST_PERIOD` apart.
        """
        self.name = name
        self._warn = warn
        self._clock = clock
        self._lock = threading.Lock()
        self._counts: Dict[str, int] = {}
        self._reported_counts: Dict[str, int] = {}
        self._last_report = clock()
        self._problems: Dict[str, _Problem] = {}
        self._values: Dict[str, str] = {}
        self._inputs: Dict[str, _Input] = {}
        self._processing = [0, 0.0, 0.0]

    def count(self, what: str, number: int = 1) -> None:
        """Add to a counter; its total and its rate are reported."""
        with self._lock:
            self._counts[what] = self._counts.get(what, 0) + number

    def total(self, what: str, total: int) -> None:
        """Set a counter that is kept elsewhere; its total and its rate are reported."""
        with self._lock:
            self._counts[what] = total

    def heard(self, topic: str) -> None:
        """Learn that a message came on a topic that the stage needs; the report says when it ceases."""
        with self._lock:
            now = self._clock()
            self._inputs.setdefault(topic, _Input(now)).take(now)

    def expect(self, topic: str) -> None:
        """Say it, too, and warn, when nothing ever comes on a topic."""
        with self._lock:
            self._inputs[topic] = _Input(self._clock(), True)

    def need_no_more(self, topic: str) -> None:
        """Learn that the stage does not listen to a topic any more."""
        with self._lock:
            self._inputs.pop(topic, None)

    def silent(self) -> Dict[str, float]:
        """Return for how many seconds each topic that is needed, and ceased, did not come."""
        with self._lock:
            now = self._clock()
            silences = {topic: one.silence(now) for topic, one in self._inputs.items()}
        return {topic: seconds for topic, seconds in silences.items() if seconds}

    def show(self, what: str, value: str) -> None:
        with self._lock:
            self._values[what] = value

    def problem(self, kind: str, detail: str, number: int = 1, level: Level = Level.WARN) -> None:
        """Count `number` problems of a kind and warn with the newest detail once in a while.

        level: that the stage has while the problem is recent.
        """
        with self._lock:
            problem = self._counted(kind, detail, number)
            problem.level = level
            since = problem.last_seen - problem.last_report
            if since < problem.period:
                return
            goes_on = since < 2.0 * problem.period
            problem.period = min(2.0 * problem.period, LONGEST_PERIOD) if goes_on else WARNING_PERIOD
            line = f"{self.name}: {problem.unreported} {kind} ({problem.total} in all): {detail}"
            problem.last_report = problem.last_seen
            problem.unreported = 0
        self._warn(line)

    def answered_problem(self, kind: str, detail: str) -> None:
        """Count a problem that somebody waits to hear of, and warn each time."""
        with self._lock:
            problem = self._counted(kind, detail, 1)
            problem.last_report = problem.last_seen
            problem.unreported = 0
        self._warn(f"{self.name}: {kind}: {detail}")

    def _counted(self, kind: str, detail: str, number: int) -> _Problem:
        problem = self._problems.setdefault(kind, _Problem())
        problem.total += number
        problem.unreported += number
        problem.last_seen = self._clock()
        problem.detail = detail
        return problem

    @contextmanager
    def timed(self) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            seconds = time.perf_counter() - start
            with self._lock:
                count, total, longest = self._processing
                self._processing = [count + 1, total + seconds, max(longest, seconds)]

    def report(self) -> HealthReport:
        """Return the state since the start, with rates since the previous report; warn of topics that never came."""
        with self._lock:
            now = self._clock()
            missed = {topic: one.missed(now) for topic, one in self._inputs.items()}
        for topic, seconds in missed.items():
            if seconds:
                self._warn(f"{self.name}: nothing came on {topic} for {seconds:.0f} s: does anybody publish it?")
        with self._lock:
            now = self._clock()
            values = self._counter_values(max(now - self._last_report, 1e-9))
            self._last_report = now
            values.update(self._values)
            values.update(self._processing_values())
            values.update({kind: str(problem.total) for kind, problem in self._problems.items()})
            recent = {
                f"{problem.total} {kind}: {problem.detail}": problem.level
                for kind, problem in self._problems.items()
                if now - problem.last_seen < WARNING_PERIOD
            }
        ceased = {f"nothing on {topic} for {seconds:.0f} s": Level.WARN for topic, seconds in self.silent().items()}
        recent = {**ceased, **recent}
        return HealthReport(max(recent.values(), default=Level.OK), "; ".join(recent) or "running", values)

    def _counter_values(self, seconds: float) -> Dict[str, str]:
        values = {}
        for what, total in self._counts.items():
            values[what] = str(total)
            values[f"{what} per second"] = f"{(total - self._reported_counts.get(what, 0)) / seconds:.2f}"
        self._reported_counts = dict(self._counts)
        return values

    def _processing_values(self) -> Dict[str, str]:
        count, total, longest = self._processing
        if not count:
            return {}
        return {
            "processing time mean [ms]": f"{1e3 * total / count:.3f}",
            "processing time longest [ms]": f"{1e3 * longest:.3f}",
        }
