"""Prints which causes are named where nothing is broken: none is wanted.

Each recording is mapped as `map_bag RECORDING --refine` does it. "live": what mlsm_core would have said meanwhile. The
odometry of simulated tours has the usual errors of a DVL and a compass, drawn with the seed, or more of one kind.
"""

import re
from functools import partial
from pathlib import Path
from typing import Callable, Dict, List, Set

import numpy as np

from benchmarks.faults import shortened
from benchmarks.harness import MARINA, WHOLE_MARINA, benchmark_parser, mapped_as, recorded
from benchmarks.live_faults import told_by
from benchmarks.tours import simulated
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.offline.bag_mapping import MappedBag
from mlsm_manager.offline.recording import Recording, read_recording
from mlsm_manager.offline.replay import ReplayParameters
from recordings.bags.bag import RecordingError
from recordings.reader import Request

_BAGS = (
    "micron_static.bag", "micron_scanline.bag", "tritech_micron_native.bag", MARINA, "marina_first_dvl.bag",
    WHOLE_MARINA,
)  # fmt: skip
_TOURS = ("harbour", "harbour_ahead", "basin", "basin_ahead", "harbour_turning")
_ERRORS = {"usual errors": {}, "current of 0.1 m/s": {"current": 0.1}, "compass drifts": {"heading_walk": 0.001}}
_LOGS = "ping360_logs"


def recordings(seeds: List[int]) -> Dict[str, Callable[[], Recording]]:
    """Return how to get each recording, by its name, the short ones first."""
    bags = sorted(recorded(_LOGS).iterdir()) + [recorded(name) for name in _BAGS]
    return {
        **{bag.name: partial(_read, bag) for bag in bags},
        **{
            f"{tour}, {what}, seed {seed}": partial(_drawn, tour, seed, errors)
            for seed in seeds
            for what, errors in _ERRORS.items()
            for tour in _TOURS
        },
        **{f"{tour}, compass alone": partial(_without_positions, partial(_drawn, tour, 1, {})) for tour in _TOURS},
        f"{WHOLE_MARINA}, compass alone": partial(_without_positions, partial(_read, recorded(WHOLE_MARINA))),
    }


def _read(path: Path) -> Recording:
    return read_recording(path, Request())


def _drawn(tour: str, seed: int, errors: Dict[str, float]) -> Recording:
    return simulated(f"{tour}_tour").with_dvl(seed, **errors)


def _without_positions(made: Callable[[], Recording]) -> Recording:
    return made().without_positions()


def live_causes(recording: Recording, kind: OdometryKind) -> Set[str]:
    """Return what is said while the run goes on, to whom the kind of the odometry is told."""
    parameters = ReplayParameters().changed(profile_values(kind))
    return {text for told in told_by(recording, parameters) for text in told.causes}


def offline_causes(mapped: MappedBag) -> Set[str]:
    """Return what is said of the whole run."""
    trust = None if mapped.findings is None else mapped.findings.trust
    return set() if trust is None else {cause.text for cause in trust.causes}


def main() -> None:
    """Print the table, line by line, and how many recordings have causes."""
    parser = benchmark_parser("honest", __doc__)
    parser.add_argument("--rows", default=".", metavar="REGEX", help="of which recordings; default: all")
    parser.add_argument("--seeds", type=int, nargs="+", default=[12], help="of tours (default: 12)")
    parser.add_argument("--seconds", type=float, default=600.0, help="of each recording (default: %(default)g)")
    parser.add_argument("--begins", type=float, nargs="+", default=[0.0], metavar="SECONDS", help="of what is mapped")
    arguments = parser.parse_args()
    runs, offline, live = 0, 0, 0
    for name, made in recordings(arguments.seeds).items():
        for begin in arguments.begins if re.search(arguments.rows, name) else []:
            said = _said(f"{name}, {begin:g} s", partial(_window, made, arguments.seconds, begin))
            runs, offline, live = runs + 1, offline + bool(said[0]), live + bool(said[1])
    print(f"{runs} recordings: {offline} with a cause offline, {live} live")


def _window(made: Callable[[], Recording], seconds: float, begin: float) -> Recording:
    recording = made()
    lasts = float(np.ptp(recording.track.times))
    if begin >= lasts:
        raise RecordingError(f"it lasts {lasts:.0f} s")
    return shortened(recording, seconds, begin)


def _said(name: str, made: Callable[[], Recording]) -> List[Set[str]]:
    """Print and return what is said of a recording, offline and live."""
    try:
        recording = made()
        mapped = mapped_as(recording, "--refine")
        said = [offline_causes(mapped), live_causes(recording, mapped.odometry.kind)]
    except RecordingError as refused:
        print(f"{name:50} refused: {refused}", flush=True)
        return [set(), set()]
    print(
        f"{name:50} offline: {'; '.join(sorted(said[0])) or '-'}   live: {'; '.join(sorted(said[1])) or '-'}",
        flush=True,
    )
    return said
