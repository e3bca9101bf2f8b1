"""Where a vehicle finds itself again after its sonar heard nothing for two minutes, while it moved on.

One line per tour, odometry, kind of silence and beginning of it. The error is that of the position against where it
should be. "Wrong but stated as sure" is the share of all fixes since the silence that are wrong and farther off than
three stated deviations.
"""

import re
from itertools import product
from typing import Iterator

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


def _told(found: Replayed, truth: Track, start: float) -> str:
    """Return what became of a replay with a silence from `start` [s] on; truth: T_map_base as it should be."""
    fixes = [one for one in found.updates if one.accepted and one.result is not None]
    times = np.array([one.scan.reference_time for one in fixes])
    error = np.hypot(*(np.array([one.result.pose[:2] for one in fixes]) - truth.at(times)[:, :2]).T)
    stated = np.array([np.sqrt(np.trace(one.result.covariance[:2, :2])) for one in fixes])
    after = times > start + _SECONDS
    way = np.hypot(*np.diff(truth.at(np.array([start, start + _SECONDS]))[:, :2], axis=0)[0])
    lies = (error > np.maximum(_SURE * stated, _WRONG))[after].mean() if after.any() else np.nan
    # From the first fix on that claims to be good.
    known = np.flatnonzero(after & (stated < _FIXED))
    turns = int((after[: known[0] + 1] if len(known) else after).sum())
    first, first_stated = (error[known[0]], stated[known[0]]) if len(known) else (np.nan, np.nan)
    most = error[known].max() if len(known) else np.nan
    return (
        f"{way:.0f} m on, error before {error[times < start][-1]:.2f} m; first fix after {turns} scans {first:.2f} m "
        f"off with {first_stated:.2f} m stated; then at most {most:.2f} m, at the end {error[-1]:.2f} m; wrong but "
        f"stated as sure {100.0 * lies:.0f} %"
    )


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
                found = replay(silent, scans, parameters, lambda count: None)
                yield f"{case}: {_told(found, truth, truth.times[0] + begin)}"
