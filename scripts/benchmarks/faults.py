"""Prints what map_bag makes of recordings in which something is broken: how far off it ends, and what it says.

Each row: the recording and the fault; distance [m] from the path of the unbroken recording, in the mean of the live and
the refined path, and the refined one's largest; "stated": median of the stated deviation [m]; "covered": share of the
refined path within 2.5 of these; the cause that is named first, with the second that it names; the trust line.
A row is "SILENT" where the path is off by more than the unbroken run's stated deviation while the run is called fine.
"""

import re
from argparse import Namespace
from dataclasses import replace
from functools import lru_cache, partial
from typing import Dict, NamedTuple, Optional

import numpy as np

from benchmarks import fault_makers as broken
from benchmarks.fault_makers import Fault
from benchmarks.harness import benchmark_parser, recorded
from benchmarks.tours import simulated
from mlsm_manager.offline.bag_mapping import MappedBag, mapped_bag
from mlsm_manager.offline.findings import Trust
from mlsm_manager.offline.map_bag import map_bag_arguments
from mlsm_manager.offline.recording import Recording, read_recording, track_between
from mlsm_manager.offline.run_files import position_error
from mlsm_manager.scan_matching.scan import Track
from recordings.reader import Request

_HEADING = np.array([0.0, 0.0, 1.0])
_COVERS = 2.5  # stated deviations
SOURCES = ("marina", "harbour", "marina compass", "harbour compass")
_COMPASS = " compass"


def faults(seconds: float) -> Dict[str, Fault]:
    """Return all faults by name, for a recording of so many seconds."""
    middle = round(seconds / 2.0)
    at = partial(partial, at=middle)
    return {
        "nothing": lambda recording: recording,
        "odometry restarts": at(broken.odometry_restarts),
        "odometry jumps 30 m": at(broken.odometry_jumps, size=30.0),
        "odometry jumps 5 m": at(broken.odometry_jumps, size=5.0),
        "odometry jumps 1 m each minute": partial(broken.odometry_jumps, at=60.0, size=1.0, every=60.0),
        "odometry glitches 50 m": at(broken.odometry_glitches, size=50.0),
        "odometry glitches 3 m for 5 poses": at(broken.odometry_glitches, size=3.0, samples=5),
        "odometry frozen 60 s, goes on": at(broken.odometry_freezes, seconds=60.0),
        "odometry frozen 60 s, then right": at(broken.odometry_freezes, seconds=60.0, goes_on=False),
        "odometry frozen to the end": at(broken.odometry_freezes),
        "odometry missing 60 s": at(broken.odometry_missing, seconds=60.0),
        "odometry 10 % short": partial(broken.odometry_scaled, factor=0.9),
        "odometry 10 % long": partial(broken.odometry_scaled, factor=1.1),
        "odometry half from then on": at(broken.odometry_scaled, factor=0.5),
        "DVL turned 10 deg": partial(broken.dvl_turned, degrees=10.0),
        "DVL turned 30 deg": partial(broken.dvl_turned, degrees=30.0),
        "compass steps 20 deg": at(broken.compass_steps, degrees=20.0),
        "compass steps 20 deg, positions right": at(broken.compass_steps, degrees=20.0, positions_follow=False),
        "compass steps 8 deg": at(broken.compass_steps, degrees=-8.0),
        "compass drifts 2 deg/min": at(broken.compass_drifts, degrees_per_minute=2.0),
        "compass sine of 8 deg": partial(broken.compass_deviates, degrees=8.0),
        "compass double sine of 8 deg": partial(broken.compass_deviates, degrees=8.0, times=2),
        "mount turned 180 deg": partial(broken.mount_turned, degrees=180.0),
        "mount turned 90 deg": partial(broken.mount_turned, degrees=90.0),
        "mount turned -45 deg": partial(broken.mount_turned, degrees=-45.0),
        "mount turned 20 deg": partial(broken.mount_turned, degrees=20.0),
        "mount turned 5 deg": partial(broken.mount_turned, degrees=5.0),
        "mount upside down": broken.mount_upside_down,
        "mount 2 m ahead": partial(broken.mount_shifted, metres=2.0),
        "head slips 20 deg": at(broken.head_slips, degrees=20.0),
        "head slips 5 deg each minute": partial(broken.head_slips, at=60.0, degrees=5.0, every=60.0),
        "head stops 120 s": at(broken.head_stops, seconds=120.0),
        "head stops 120 s untold": at(broken.head_stops, seconds=120.0, tells=False),
        "head reversed": broken.head_reversed,
        "beams stop 120 s": at(broken.beams_stop, seconds=120.0),
        "30 % of the beams missing": partial(broken.beams_missing, share=0.3),
        "range setting halved untold": at(broken.range_changed, factor=0.5),
        "range setting x 1.5 untold": at(broken.range_changed, factor=1.5),
        "range setting halved told": at(broken.range_told, share=0.5),
        "gain x 0.3": at(broken.gain_changed, factor=0.3),
        "echoes 10 bins longer": at(broken.echoes_longer, bins=10),
        "half of the circle blind": broken.half_blind,
        "deaf 120 s": at(broken.deaf, seconds=120.0),
        "deaf to the end": at(broken.deaf),
        "spikes on each beam": partial(broken.spikes, share=1.0),
        "interference on 31 % of the beams": at(broken.spikes, share=0.31),
        "spiral of interference": at(broken.spiral),
        "stamps 2 s late": partial(broken.delayed, seconds=2.0),
        "stamps 10 s late": partial(broken.delayed, seconds=10.0),
        "stamps 3 s late from then on": at(broken.delayed, seconds=3.0),
        "delay grows to 6 s": partial(broken.delayed, seconds=6.0, growing=True),
    }


@lru_cache(maxsize=None)
def source(name: str, seconds: float) -> Recording:
    """Return the beginning of an unbroken recording."""
    if name.endswith(_COMPASS):
        whole = source(name[: -len(_COMPASS)], seconds)
        return whole.with_track(Track(whole.track.times, whole.track.poses * _HEADING))
    if name == "marina":
        return shortened(read_recording(recorded("marina_first.bag"), Request()), seconds)
    return shortened(simulated("harbour_ahead_tour").with_dvl(1), seconds)


def shortened(recording: Recording, seconds: float) -> Recording:
    """Return the first seconds of a recording."""
    end = recording.track.times[0] + seconds
    track = track_between(recording.track, recording.track.times[0], end)
    beams = [placed for placed in recording.beams if placed.beam.stamp_ns * 1e-9 < track.times[-1]]
    return replace(recording, beams=beams, track=track)


class Outcome(NamedTuple):
    """live, refined, most: m from the unbroken run. stated: m, median. covered: share. cause: first named.

    line: of the trust. silent: whether the run is called fine where it is not.
    """

    live: float
    refined: float
    most: float
    stated: float
    covered: float
    cause: str
    line: str
    silent: bool


def mapped(recording: Recording) -> MappedBag:
    """Return what `map_bag RECORDING --refine` makes of it."""
    return mapped_bag(recording, map_bag_options())


def map_bag_options() -> Namespace:
    """Return the options of the command."""
    return map_bag_arguments(["recording", "--out", "nowhere", "--refine"])


def distance(one: np.ndarray, times: np.ndarray, whole: MappedBag, poses: np.ndarray) -> np.ndarray:
    """Return how far (m,) the path `one` (m, >= 2) at `times` is from `poses` of the unbroken run; both begin at one
    place.
    """
    other = Track(whole.run.times, poses).at(times)[:, :2]
    return np.hypot(*(one[:, :2] - one[0, :2] - other + other[0]).T)


def outcome(found: MappedBag, whole: MappedBag) -> Outcome:
    """Return the figures of a broken run against the unbroken one."""
    live = distance(found.run.poses["corrected"], found.run.times, whole, whole.run.best)
    refined = distance(found.run.best, found.run.times, whole, whole.run.best)
    trust = found.findings.trust
    stated = np.interp(found.run.times, trust.times, trust.deviations)
    held = float(np.median(whole.findings.trust.deviations))
    wrong = refined.mean() > held and not trust.line.startswith("trust: DOUBTFUL")
    return Outcome(
        live.mean(), refined.mean(), refined.max(), float(np.median(stated)),
        float(np.mean(refined <= _COVERS * stated)), _first_cause(trust), trust.line, wrong,
    )  # fmt: skip


def _first_cause(trust: Trust) -> str:
    return trust.causes[0].line(float(trust.times[0])) if trust.causes else "-"


def main() -> None:
    """Print the table, line by line."""
    parser = benchmark_parser("faults", __doc__)
    parser.add_argument("--rows", default=".", metavar="REGEX", help="which ones, of 'SOURCE: FAULT'; default: all")
    parser.add_argument("--sources", nargs="+", default=SOURCES[:2], choices=SOURCES, help="default: %(default)s")
    parser.add_argument("--seconds", type=float, default=600.0, help="of each recording (default: %(default)g)")
    parser.add_argument("--truth", action="store_true", help="print the distance from the truth as well")
    arguments = parser.parse_args()
    wanted = re.compile(arguments.rows)
    for name in arguments.sources:
        recording, whole = source(name, arguments.seconds), None
        for fault, make in faults(recording.seconds).items():
            if wanted.search(f"{name}: {fault}"):
                whole = whole or mapped(recording)
                print_row(f"{name}: {fault}", make(recording), whole, arguments.truth)


def print_row(name: str, recording: Recording, whole: MappedBag, with_truth: bool) -> Optional[Outcome]:
    """Map a broken recording and print its row; one that is refused is told as refused."""
    found = mapped(recording)
    row = outcome(found, whole)
    truth = (
        f"  truth {position_error(found.run.times, found.run.best, recording.truth)['mean']:.2f}" if with_truth else ""
    )
    print(
        f"{name:55} {row.live:6.2f} {row.refined:6.2f} most {row.most:6.2f} stated {row.stated:6.2f} "
        f"covered {100 * row.covered:3.0f} %{truth}  {'SILENT' if row.silent else ''}\n    {row.cause}\n    {row.line}",
        flush=True,
    )
    return row


if __name__ == "__main__":
    main()
