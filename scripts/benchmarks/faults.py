"""What map_bag makes of recordings in which something is broken: how far off it ends, and what it says.

Each row: the recording and the fault; distance [m] from the path of the unbroken recording, in the mean of the live and
the refined path, and the refined one's largest; "stated": median of the stated deviation [m]; "covered": share of the
refined path within 2.5 of these; the cause that is named first, with the second that it names, or what
is assumed; the trust line.
A row is "held" where the refined path is off by no more than the unbroken run's stated deviation; else "SILENT" where
its checks are called fine, "named, covered" where the right cause is named first and 95 % of the path are within 2.5
stated deviations, and "missed" where not.
"""

import re
import sys
from collections import Counter
from dataclasses import replace
from enum import Enum
from functools import lru_cache
from typing import Dict, Iterator, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from benchmarks.fault_makers import Fault
from benchmarks.fault_rows import FaultRow, faults
from benchmarks.harness import WHOLE_MARINA, mapped_as, marina, recorded
from benchmarks.tours import simulated
from mlsm_manager.offline.bag_mapping import MappedBag
from mlsm_manager.offline.recording import Recording, read_recording, track_between
from mlsm_manager.offline.run_files import position_error
from mlsm_manager.scan_matching.scan import Track
from recordings.bags.bag import RecordingError
from recordings.reader import Request

_COVERS, _MOSTLY = 2.5, 0.95  # stated deviations, which are to hold so large a share of the path
_TOURS = {"harbour": "harbour_ahead", "basin": "basin_ahead", "turning": "harbour_turning"}
_COMPASS = " compass"
USUAL = ("marina", "harbour")
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
    track = track_between(recording.track, recording.track.times[0] + begin, recording.track.times[0] + begin + seconds)
    first, last = track.times[[0, -1]]
    beams = [placed for placed in recording.beams if first <= placed.beam.stamp_ns * 1e-9 < last]
    return replace(recording, beams=beams, track=track)


def ending(recording: Recording, seconds: float) -> Recording:
    """Return the last seconds of a recording."""
    return shortened(recording, seconds, recording.seconds - seconds)


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
    covered, cause = float(np.mean(refined <= _COVERS * stated)), trust.assumed.text or "-"
    if trust.causes:
        cause = trust.causes[0].line(float(trust.times[0]))
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


class Broken(NamedTuple):
    """A recording to be broken. source: its name. whole: as it is. fault: what is to be broken, by `make`."""

    source: str
    whole: Recording
    fault: str
    row: FaultRow
    make: Fault

    @property
    def name(self) -> str:
        """Of the row."""
        return f"{self.source}: {self.fault}"


def broken_recordings(rows: str, sources: Sequence[str], seconds: float, seed: Optional[int]) -> Iterator[Broken]:
    """Yield those that a regular expression finds in 'SOURCE: FAULT'. Ends the program for an unknown source."""
    unknown = sorted(set(sources) - set(SOURCES))
    if unknown:
        sys.exit(f"scripts/bench: --sources {', '.join(unknown)}: must be among {', '.join(SOURCES)}")
    for name in sources:
        whole = source(name, seconds)
        for fault, (row, make) in faults(whole.seconds, seed).items():
            broken = Broken(name, whole, fault, row, make)
            if re.search(rows, broken.name):
                yield broken


def lines(
    rows: str = ".", sources: Tuple[str, ...] = USUAL, seconds: float = 600.0, seed: Optional[int] = None,
    truth: bool = False,
) -> Iterator[str]:  # fmt: skip
    """Yield the rows that a regular expression finds in 'SOURCE: FAULT', and at last how many of them are what.

    seconds: of each recording. seed: of other sizes and times than the usual ones. truth: tell the refined path's mean
    distance from the truth as well, which the canal has none of.
    """
    counts: Dict[Judged, int] = Counter()
    unbroken = lru_cache(maxsize=None)(lambda name: mapped_as(source(name, seconds), "--refine"))
    for broken in broken_recordings(rows, sources, seconds, seed):
        whole = unbroken(broken.source)
        try:
            found = mapped_as(broken.make(broken.whole), "--refine")
        except RecordingError as refused:
            counts[Judged.HELD] += 1
            yield f"{broken.name:55} refused: {refused}"
            continue
        row = outcome(found, whole, broken.row.right_causes(broken.source.endswith(_COMPASS)))
        counts[row.judged] += 1
        told = row.judged.value
        if truth:
            error = position_error(found.run.times, found.run.best, broken.whole.truth)["mean"]
            told = f"truth {error:.2f}  {told}"
        yield (
            f"{broken.name:55} {row.live:6.2f} {row.refined:6.2f} most {row.most:6.2f} stated {row.stated:6.2f} "
            f"covered {100 * row.covered:3.0f} %  {told}\n    {row.cause}\n    {row.line}"
        )
    yield ", ".join(f"{counts[judged]} {judged.value}" for judged in Judged)
