"""Which causes are named where nothing is broken: none is wanted.

Each recording is mapped as `map_bag RECORDING --refine` does it. "live": what mlsm_core would have said meanwhile. The
odometry of simulated tours has the usual errors of a DVL and a compass, drawn with the seed, or more of one kind.
"""

import re
from functools import partial
from itertools import product
from typing import Callable, Dict, Iterator, Sequence, Tuple

from benchmarks.faults import shortened
from benchmarks.harness import MARINA, WHOLE_MARINA, mapped_as, recorded
from benchmarks.live_faults import told_by
from benchmarks.tours import simulated
from mlsm_manager.offline.recording import Recording, read_recording
from recordings.bags.bag import RecordingError
from recordings.reader import Request

_BAGS = (
    "micron_static.bag", "micron_scanline.bag", "tritech_micron_native.bag", MARINA, "marina_first_dvl.bag",
    WHOLE_MARINA,
)  # fmt: skip
_TOURS = ("harbour", "harbour_ahead", "basin", "basin_ahead", "harbour_turning")
_ERRORS = {"usual errors": {}, "current of 0.1 m/s": {"current": 0.1}, "compass drifts": {"heading_walk": 0.001}}


def _recordings(seeds: Sequence[int]) -> Dict[str, Callable[[], Recording]]:
    """Return how to get each recording, by its name, the short ones first."""
    bags = sorted(recorded("ping360_logs").iterdir()) + [recorded(name) for name in _BAGS]
    made = {bag.name: partial(read_recording, bag, Request()) for bag in bags}
    for seed, (what, errors), tour in product(seeds, _ERRORS.items(), _TOURS):
        made[f"{tour}, {what}, seed {seed}"] = partial(_drawn, tour, seed, **errors)
    alone = {tour: partial(_drawn, tour, 1) for tour in _TOURS}
    alone[WHOLE_MARINA] = made[WHOLE_MARINA]
    return {
        **made,
        **{f"{name}, compass alone": lambda one=one: one().without_positions() for name, one in alone.items()},
    }


def _drawn(tour: str, seed: int, **errors: float) -> Recording:
    return simulated(f"{tour}_tour").with_dvl(seed, **errors)


def lines(
    rows: str = ".", seeds: Tuple[int, ...] = (12,), seconds: float = 600.0, begins: Tuple[float, ...] = (0.0,)
) -> Iterator[str]:
    """Yield what is said of each recording that a regular expression finds, and at last how many have causes.

    seeds: of tours. seconds: of each recording, from each of `begins` on.
    """
    runs, offline, live = 0, 0, 0
    for name, made in _recordings(seeds).items():
        for begin in begins if re.search(rows, name) else []:
            runs += 1
            title = f"{name}, {begin:g} s"
            try:
                recording = made()
                if begin >= recording.seconds:
                    raise RecordingError(f"it lasts {recording.seconds:.0f} s")
                recording = shortened(recording, seconds, begin)
                mapped = mapped_as(recording, "--refine")
                told = {text for one in told_by(recording, mapped.odometry.kind) for text in one.causes}
            except RecordingError as refused:
                yield f"{title:50} refused: {refused}"
                continue
            said = {cause.text for cause in mapped.findings.trust.causes} if mapped.findings else set()
            offline, live = offline + bool(said), live + bool(told)
            yield f"{title:50} offline: {'; '.join(sorted(said)) or '-'}   live: {'; '.join(sorted(told)) or '-'}"
    yield f"{runs} recordings: {offline} with a cause offline, {live} live"
