"""Where a vehicle finds itself again after its sonar heard nothing for two minutes, while it moved on.

One line per tour, odometry, kind of silence and beginning of it. The error is that of the position against where it
should be.
"""

import re
from itertools import product
from typing import Iterator, NamedTuple

import numpy as np

from benchmarks.fault_makers import beams_stop, deaf, odometry_missing
from benchmarks.paths import replay_input
from benchmarks.tours import simulated
from benchmarks.twin_conditions import TwinParameters, reported
from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.offline.replay import Replayed, replay
from mlsm_manager.scan_matching.scan import Track

_TOURS = ("harbour_ahead_tour", "basin_ahead_tour")
_SHARES = (0.4, 0.55, 0.7)  # of the run's length, where the silence begins
_SECONDS = 120.0  # of silence
_SURE = 3.0  # stated deviations
_FIXED = 6.0  # m stated, below which a place is known
_WRONG = 3.0  # m: as far off no wall of the map is met, and a second one is drawn
_SILENCES = {"no beams": beams_stop, "beams without echoes": deaf, "neither beams nor odometry": odometry_missing}
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


def _figures(found: Replayed, truth: Track, start: float) -> Figures:
    """Return those of a replay with a silence from `start` [s] on; truth: T_map_base as it should be."""
    fixes = [one for one in found.updates if one.accepted and one.result is not None]
    times = np.array([one.scan.reference_time for one in fixes])
    error = np.hypot(*(np.array([one.result.pose[:2] for one in fixes]) - truth.at(times)[:, :2]).T)
    stated = np.array([np.sqrt(np.trace(one.result.covariance[:2, :2])) for one in fixes])
    before, after = times < start, times > start + _SECONDS
    way = float(np.hypot(*np.diff(truth.at(np.array([start, start + _SECONDS]))[:, :2], axis=0)[0]))
    lies = float((error > np.maximum(_SURE * stated, _WRONG))[after].mean()) if after.any() else np.nan
    known = np.flatnonzero(after & (stated < _FIXED))
    if not len(known):
        return Figures(error[before][-1], way, int(after.sum()), np.nan, np.nan, error[-1], np.nan, lies)
    first = int(known[0])
    turns = int(after[: first + 1].sum())
    return Figures(error[before][-1], way, turns, error[first], stated[first], error[-1], error[known].max(), lies)


def lines(rows: str = ".") -> Iterator[str]:
    """Yield the rows that a regular expression finds."""
    for kind, name in product((OdometryKind.HEADING, OdometryKind.DVL), _TOURS):
        tour = simulated(name)
        made = reported(tour.truth, TwinParameters(direction=0.0, scale=0.01), np.random.RandomState(0)).poses
        odometry = made * [0.0, 0.0, 1.0] if kind is OdometryKind.HEADING else made
        # The map begins where the vehicle does.
        truth = Track(tour.truth.times, tour.truth.poses - np.append(tour.truth.poses[0, :2] - odometry[0, :2], 0.0))
        recording = tour.recording(Track(tour.truth.times, odometry))
        for missing, share in product(_SILENCES, _SHARES):
            begin = share * recording.seconds
            case = f"{name}, seed 0, {kind.value.lower()}, {missing} from {begin:.0f} s on"
            if re.search(rows, case):
                silent = _SILENCES[missing](recording, begin, _SECONDS)
                scans, parameters = replay_input(silent, kind)
                found = _figures(replay(silent, scans, parameters, lambda count: None), truth, truth.times[0] + begin)
                yield f"{case}: {found.line()}"
