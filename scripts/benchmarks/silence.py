"""Prints where a vehicle finds itself again after its sonar heard nothing for minutes, while it moved on.

One line per tour, odometry, kind of silence and beginning of it. The error is that of the position against where it
should be, the marina's against the path by its own DVL without the silence.
"""

from itertools import chain
from typing import Iterator, List, NamedTuple, Tuple

import numpy as np

from benchmarks import harness
from benchmarks.fault_makers import beams_stop, deaf, odometry_missing
from benchmarks.harness import benchmark_parser
from benchmarks.paths import replay_input
from benchmarks.tours import simulated
from benchmarks.twin_conditions import TwinParameters, reported
from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.replay import Replayed, replay
from mlsm_manager.scan_matching.scan import Track

TOURS = ("harbour_ahead_tour", "basin_ahead_tour")
SHARES = (0.4, 0.55, 0.7)  # of the run's length, where the silence begins
_SURE = 3.0  # stated deviations
_FIXED = 6.0  # m stated, below which a place is known
_WRONG = 3.0  # m: as far off no wall of the map is met, and a second one is drawn


SILENCES = {"no beams": beams_stop, "beams without echoes": deaf, "neither beams nor odometry": odometry_missing}
"""What is missing in the recording, and what takes it out."""


class Figures(NamedTuple):
    """Of the fixes after a silence.

    before: error of the last fix before it [m]. way: by which the vehicle was carried on meanwhile [m]. turns: scans
    until the first fix that claims to be good. first, stated: its error and deviation [m]. end: error of the last one.
    most: of all from then on. lies: share of all since the silence that are wrong and farther off than three stated
    deviations.
    """

    before: float
    way: float
    turns: int
    first: float
    stated: float
    end: float
    most: float
    lies: float

    def line(self) -> str:
        """Return them for people."""
        return (
            f"{self.way:.0f} m on, error before {self.before:.2f} m; first fix after {self.turns} scans "
            f"{self.first:.2f} m off with {self.stated:.2f} m stated; then at most {self.most:.2f} m, at the end "
            f"{self.end:.2f} m; wrong but stated as sure {100.0 * self.lies:.0f} %"
        )


def replayed(recording: Recording, kind: OdometryKind) -> Replayed:
    """Return what map_bag makes of a recording of an odometry."""
    scans, parameters = replay_input(recording, kind)
    return replay(recording, scans, parameters, lambda count: None)


def figures(found: Replayed, truth: Track, start: float, seconds: float) -> Figures:
    """Return those of a replay with a silence; truth: T_map_base as it should be."""
    fixes = [one for one in found.updates if one.accepted and one.result is not None]
    times = np.array([one.scan.reference_time for one in fixes])
    error = np.hypot(*(np.array([one.result.pose[:2] for one in fixes]) - truth.at(times)[:, :2]).T)
    stated = np.array([np.sqrt(np.trace(one.result.covariance[:2, :2])) for one in fixes])
    before, after = times < start, times > start + seconds
    way = float(np.hypot(*np.diff(truth.at(np.array([start, start + seconds]))[:, :2], axis=0)[0]))
    lies = float((error > np.maximum(_SURE * stated, _WRONG))[after].mean()) if after.any() else np.nan
    known = np.flatnonzero(after & (stated < _FIXED))
    if not len(known):
        return Figures(error[before][-1], way, int(after.sum()), np.nan, np.nan, error[-1], np.nan, lies)
    first = int(known[0])
    turns = int(after[: first + 1].sum())
    return Figures(error[before][-1], way, turns, error[first], stated[first], error[-1], error[known].max(), lies)


def tours(names: List[str], kind: OdometryKind, seeds: int) -> Iterator[Tuple[str, Recording, Track]]:
    """Yield simulated tours: name, recording and where the vehicle is in the map that begins where it does."""
    for name in names:
        tour = simulated(name)
        for seed in range(seeds):
            made = reported(tour.truth, TwinParameters(direction=0.0, scale=0.01), np.random.RandomState(seed)).poses
            odometry = made * [0.0, 0.0, 1.0] if kind is OdometryKind.HEADING else made
            origin = np.append(tour.truth.poses[0, :2] - odometry[0, :2], 0.0)
            yield (
                f"{name}, seed {seed}",
                tour.recording(Track(tour.truth.times, odometry)),
                Track(tour.truth.times, tour.truth.poses - origin),
            )


def marina(kind: OdometryKind) -> Tuple[str, Recording, Track]:
    """Return the marina's first part, and the vehicle's path in it by its DVL."""
    recording = harness.marina()
    whole = replayed(recording, OdometryKind.DVL)
    if kind is OdometryKind.HEADING:
        recording = recording.without_positions()
    return "marina", recording, Track(whole.times, whole.corrected)


def main() -> None:
    """Print one line per silence."""
    parser = benchmark_parser("silence", __doc__)
    parser.add_argument("--tours", nargs="*", default=TOURS, choices=TOURS, help="which ones; default: all")
    parser.add_argument("--odometry", nargs="+", default=["heading", "dvl"], choices=["heading", "dvl"])
    parser.add_argument("--seeds", type=int, default=1, help="compasses with each tour (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=120.0, help="of silence (default: %(default)s)")
    parser.add_argument("--marina", action="store_true", help="the marina's recording as well")
    options = parser.parse_args()
    for kind in (OdometryKind(name.upper()) for name in options.odometry):
        recordings = chain(tours(options.tours, kind, options.seeds), (marina(kind) for _ in range(options.marina)))
        for name, recording, truth in recordings:
            for missing, silence in SILENCES.items():
                for share in SHARES:
                    begin = share * recording.seconds
                    played = replayed(silence(recording, begin, options.seconds), kind)
                    found = figures(played, truth, recording.track.times[0] + begin, options.seconds)
                    case = f"{name}, {kind.value.lower()}, {missing} from {begin:.0f} s on"
                    print(f"{case}: {found.line()}", flush=True)
