"""Prints what map_bag makes of recordings in which something is broken: how far off it ends, and what it says.

Each row: the recording and the fault; distance [m] from the path of the unbroken recording, in the mean of the live and
the refined path, and the refined one's largest; "stated": median of the stated deviation [m]; "covered": share of the
refined path within 2.5 of these; the cause that is named first, with the second that it names, or what
is assumed; the trust line.
A row is "held" where the refined path is off by no more than the unbroken run's stated deviation; else "SILENT" where
its checks are called fine, "named, covered" where the right cause is named first and 95 % of the path are within 2.5
stated deviations, and "missed" where not.
"""

import re
from argparse import ArgumentParser
from collections import Counter
from dataclasses import replace
from enum import Enum
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from benchmarks.fault_rows import faults
from benchmarks.harness import WHOLE_MARINA, benchmark_parser, mapped_as, marina, recorded
from benchmarks.tours import simulated
from mlsm_manager.offline.bag_mapping import MappedBag
from mlsm_manager.offline.recording import Recording, read_recording, track_between
from mlsm_manager.offline.run_files import position_error
from mlsm_manager.offline.trust import Trust
from mlsm_manager.scan_matching.scan import Track
from recordings.bags.bag import RecordingError
from recordings.reader import Request

_COVERS, _MOSTLY = 2.5, 0.95  # stated deviations, which are to hold so large a share of the path
_TOURS = {"harbour": "harbour_ahead", "basin": "basin_ahead", "turning": "harbour_turning"}
_COMPASS = " compass"
_USUAL = ["marina", "harbour"]
SOURCES = [name + form for form in ("", _COMPASS) for name in ("marina", "canal", *_TOURS)]


@lru_cache(maxsize=None)
def source(name: str, seconds: float) -> Recording:
    """Return the beginning of an unbroken recording; of the canal the end, which is beyond the marina's first part."""
    if name.endswith(_COMPASS):
        return source(name[: -len(_COMPASS)], seconds).without_positions()
    if name == "marina":
        return shortened(marina(truth="/ground_truth"), seconds)
    if name == "canal":
        return ending(read_recording(recorded(WHOLE_MARINA), Request()), seconds)
    return shortened(simulated(f"{_TOURS[name]}_tour").with_dvl(1), seconds)


def shortened(recording: Recording, seconds: float, begin: float = 0.0) -> Recording:
    """Return some seconds of a recording, from `begin` [s] on."""
    start = recording.track.times[0] + begin
    return _between(recording, start, start + seconds)


def ending(recording: Recording, seconds: float) -> Recording:
    """Return the last seconds of a recording."""
    return _between(recording, recording.track.times[-1] - seconds, recording.track.times[-1])


def _between(recording: Recording, begin: float, end: float) -> Recording:
    track = track_between(recording.track, begin, end)
    first, last = track.times[[0, -1]]
    beams = [placed for placed in recording.beams if first <= placed.beam.stamp_ns * 1e-9 < last]
    return replace(recording, beams=beams, track=track)


class Judged(Enum):
    """What a row is. The first two are wanted, the last is never to happen."""

    HELD = "held"
    NAMED = "named, covered"
    MISSED = "missed"
    SILENT = "SILENT"


class Outcome(NamedTuple):
    """live, refined, most: m from the unbroken run. stated: m, median. covered: share. cause: first named.

    line: of the trust.
    """

    live: float
    refined: float
    most: float
    stated: float
    covered: float
    cause: str
    line: str
    judged: Judged


def distance(one: np.ndarray, times: np.ndarray, whole: MappedBag, poses: np.ndarray) -> np.ndarray:
    """Return how far (m,) the path `one` (m, >= 2) at `times` is from `poses` of the unbroken run; both begin at one
    place.
    """
    other = Track(whole.run.times, poses).at(times)[:, :2]
    return np.hypot(*(one[:, :2] - one[0, :2] - other + other[0]).T)


def outcome(found: MappedBag, whole: MappedBag, named: str) -> Outcome:
    """Return the figures of a broken run against the unbroken one; named: a regular expression of right causes."""
    live = distance(found.run.poses["corrected"], found.run.times, whole, whole.run.best)
    refined = distance(found.run.best, found.run.times, whole, whole.run.best)
    trust = found.findings.trust
    stated = np.interp(found.run.times, trust.times, trust.deviations)
    covered, cause = float(np.mean(refined <= _COVERS * stated)), _first_cause(trust)
    judged = Judged.MISSED
    if refined.mean() <= float(np.median(whole.findings.trust.deviations)):
        judged = Judged.HELD
    elif not trust.line.startswith(("trust: DOUBTFUL", "trust: NOT MEASURED")):
        judged = Judged.SILENT
    elif named and re.search(named, cause) and covered >= _MOSTLY:
        judged = Judged.NAMED
    return Outcome(
        live.mean(), refined.mean(), refined.max(), float(np.median(stated)), covered, cause, trust.line, judged
    )  # fmt: skip


def _first_cause(trust: Trust) -> str:
    if trust.causes:
        return trust.causes[0].line(float(trust.times[0]))
    return trust.assumed.text or "-"


def fault_parser(name: str, about: str) -> ArgumentParser:
    """Return a parser of a study that breaks recordings."""
    parser = benchmark_parser(name, about)
    parser.add_argument("--rows", default=".", metavar="REGEX", help="which ones, of 'SOURCE: FAULT'; default: all")
    parser.add_argument("--sources", nargs="+", default=_USUAL, choices=SOURCES, help="default: %(default)s")
    parser.add_argument("--seconds", type=float, default=600.0, help="of each recording (default: %(default)g)")
    parser.add_argument("--seed", type=int, help="of other sizes and times than the usual ones")
    return parser


def main() -> None:
    """Print the table, line by line, and how many rows are what."""
    parser = fault_parser("faults", __doc__)
    parser.add_argument("--truth", action="store_true", help="print the distance from the truth as well")
    arguments = parser.parse_args()
    wanted, counts = re.compile(arguments.rows), Counter()
    for name in arguments.sources:
        recording, whole = source(name, arguments.seconds), None
        for fault, (row, make) in faults(recording.seconds, arguments.seed).items():
            if wanted.search(f"{name}: {fault}"):
                whole = whole or mapped_as(recording, "--refine")
                named = row.right_causes(name.endswith(_COMPASS))
                counts[print_row(f"{name}: {fault}", make(recording), whole, named, arguments.truth)] += 1
    print(", ".join(f"{counts[judged]} {judged.value}" for judged in Judged))


def print_row(name: str, recording: Recording, whole: MappedBag, named: str, with_truth: bool) -> Judged:
    """Map a broken recording, print its row, and return what it is."""
    try:
        found = mapped_as(recording, "--refine")
    except RecordingError as refused:
        print(f"{name:55} refused: {refused}", flush=True)
        return Judged.HELD
    row = outcome(found, whole, named)
    truth = (
        f"  truth {position_error(found.run.times, found.run.best, recording.truth)['mean']:.2f}" if with_truth else ""
    )
    print(
        f"{name:55} {row.live:6.2f} {row.refined:6.2f} most {row.most:6.2f} stated {row.stated:6.2f} "
        f"covered {100 * row.covered:3.0f} %{truth}  {row.judged.value}\n    {row.cause}\n    {row.line}",
        flush=True,
    )
    return row.judged
