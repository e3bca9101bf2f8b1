"""What every node tells of itself on /diagnostics, as the page lists it."""

import time
from typing import Callable, Dict, List, Mapping, Tuple

from node_support.health import HealthReport
from web_page.board import WORDS, Board
from web_page.messages import text_of

_PERIOD = 2.0  # s between two reports of a stage
_MOST_STAGES, _MOST_VALUES, _LONGEST = 64, 40, 240
_RATE = " per second"
_ANSWERS = ("fine: ", "DOUBTFUL: ", "not measured: ")  # how checks begin: mlsm_manager's self_check.verdict.Answer
_CAUSES, _NO_CAUSE = "causes", "none found"


class Stages:
    """Shows the reports of all stages, each as often as a person reads it."""

    def __init__(self, board: Board, clock: Callable[[], float] = time.monotonic) -> None:
        self._board, self._clock = board, clock
        self._shown: Dict[str, float] = {}

    def take(self, name: str, report: HealthReport) -> None:
        """Show the report of a stage, named "node: stage", unless its last one is fresh."""
        name, now = name[:_LONGEST], self._clock()
        if name not in self._shown and len(self._shown) >= _MOST_STAGES:
            return
        if now - self._shown.get(name, -_PERIOD) < 0.9 * _PERIOD:
            return
        self._shown[name] = now
        told = {"name": name, "level": report.level, "text": report.text[:_LONGEST], "counts": counts(report.values)}
        told["checks"] = checks(report.values)
        cause = report.values.get(_CAUSES, _NO_CAUSE)[:_LONGEST]
        if cause != _NO_CAUSE:
            told["cause"] = cause
        self._board.put(("stage", name), text_of(stage=told), WORDS)


def counts(values: Mapping[str, str]) -> List[Tuple[str, str, str]]:
    """Return name, total and rate of what a stage counts."""
    names = [name for name in values if name + _RATE in values][:_MOST_VALUES]
    return [(name[:_LONGEST], values[name][:_LONGEST], values[name + _RATE][:_LONGEST]) for name in names]


def checks(values: Mapping[str, str]) -> List[Tuple[str, str, str]]:
    """Return name, answer and reason of each check."""
    found = []
    for name, value in values.items():
        answer = next((answer for answer in _ANSWERS if value.startswith(answer)), None)
        if answer is not None:
            found.append((name[:_LONGEST], answer[:-2], value[len(answer) : _LONGEST]))
    return found[:_MOST_VALUES]
