"""Prints whether a vehicle that knows nothing of its place finds itself in a stored map, and whether it is right.

Each map is drawn with an exact odometry, whole or of the first part of a tour. A vehicle is then put into it at many
moments of another tour of the same water, with an odometry of usual errors in a frame of its own. It takes scans until
its position is called good, at most fifteen. A position is wrong if it is off by more than 3 m and by more than four
times what is stated. After half of a tour some vehicles are where the map has nothing: these should not be called good.
"""

from functools import partial
from typing import Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from benchmarks.canals import made_canal, made_path, recorded_along
from benchmarks.harness import benchmark_parser
from benchmarks.live_faults import is_called_good
from benchmarks.paths import replay_input
from benchmarks.tours import simulated
from mlsm_manager.localisation.joint_session import moved
from mlsm_manager.localisation.localiser import Localiser
from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.replay import ReplayParameters
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.surface_map.map_file import StoredMap

_MOST_SCANS = 15
_WRONG, _SURE = 3.0, 4.0  # m, stated deviations
_FAR = 100.0  # m, by which the odometry's frame is elsewhere
_NOWHERE = 1e4  # m, where no map is
_CANAL_STARTS = 2  # a search of a map of 340 m takes ten times as long


class Case(NamedTuple):
    """A map, and another run in the same water. truth: T_map_base of that run."""

    mapped: Recording
    other: Recording
    truth: Track


class Start(NamedTuple):
    """scans: until the position was called good; None where it never was. error, stated: then [m]."""

    scans: Optional[int]
    error: float
    stated: float

    @property
    def is_wrong(self) -> bool:
        """Whether a position that is called good is not where the vehicle is."""
        return self.scans is not None and self.error > max(_WRONG, _SURE * self.stated)


def tour_case(name: str, **errors: float) -> Case:
    """Return two runs of a simulated tour, the second with `errors` of its odometry (see TwinParameters)."""
    first, second = simulated(name, seed=1), simulated(name, seed=2)
    return Case(first.recording(first.truth), second.with_dvl(2, **errors), second.truth)


def elsewhere(mapped: str, other: str) -> Case:
    """Return a run in other water than that of the map, in which no place is right."""
    first, second = tour_case(mapped), tour_case(other)
    return Case(
        first.mapped, second.other, Track(second.truth.times, second.truth.poses + np.array([_NOWHERE, 0.0, 0.0]))
    )


def canal_case() -> Case:
    """Return two runs from one basin through a canal into another; its walls look alike all along."""
    water = made_canal(0, np.random.RandomState(0))
    first, second = (made_path(np.random.RandomState(seed)) for seed in (1, 2))
    mapped, other = (
        recorded_along(path, water, True, np.random.RandomState(seed), np.ones(3))
        for path, seed in ((first, 3), (second, 4))
    )
    return Case(mapped.with_track(first), other, second)


CASES = {
    "basin": (tour_case, ("basin_tour",), 1.0),
    "basin, a third of the tour": (tour_case, ("basin_tour",), 0.34),
    "basin, half of the tour": (tour_case, ("basin_tour",), 0.5),
    "basin, two thirds of the tour": (tour_case, ("basin_tour",), 0.67),
    "harbour": (tour_case, ("harbour_tour",), 1.0),
    "harbour, half of the tour": (tour_case, ("harbour_tour",), 0.5),
    "harbour ahead": (tour_case, ("harbour_ahead_tour",), 1.0),
    "harbour ahead, odometry 30 % off": (partial(tour_case, scale=0.3), ("harbour_ahead_tour",), 1.0),
    "canal, half of the tour": (canal_case, (), 0.5),
    "basin, vehicle in the harbour": (elsewhere, ("basin_tour", "harbour_tour"), 1.0),
    "harbour, vehicle in the basin": (elsewhere, ("harbour_tour", "basin_tour"), 1.0),
}
"""What makes each case, of what, and how much of its tour the map has."""


def stored_map(recording: Recording, share: float) -> Tuple[StoredMap, ReplayParameters]:
    """Return the map of the first `share` of a recording, and what it was made with."""
    scans, parameters = replay_input(recording, OdometryKind.AUTO)
    localiser = parameters.build_localiser(recording.sonar_in_base)
    for scan in scans[: int(share * len(scans))]:
        localiser.take_scan(scan)
    return localiser.stored("map", {}, 0.0, ""), parameters


def started(localiser: Localiser, scans: Iterable[Scan], truth: Track) -> Start:
    """Feed a localiser that is lost until it calls its position good."""
    for count, scan in enumerate(scans, 1):
        update = localiser.take_scan(scan).scan
        place = localiser.place_now(scan.reference_time, scan.reference_pose)
        if is_called_good(localiser, place, update.provisional):
            error = update.belief.theta[:2] - truth.at(np.array([scan.reference_time]))[0, :2]
            return Start(count, float(np.hypot(*error)), place.deviation)
    return Start(None, np.nan, np.nan)


def starts(case: Case, share: float, count: int) -> List[Start]:
    """Return what came of `count` starts all along the other run."""
    stored, parameters = stored_map(case.mapped, share)
    scans, _ = replay_input(case.other, OdometryKind.AUTO)
    rng = np.random.RandomState(5)
    found = []
    for first in (np.linspace(0.0, 0.9, count) * len(scans)).astype(int):
        frame = np.append(rng.uniform(-_FAR, _FAR, 2), rng.uniform(-np.pi, np.pi))
        localiser = parameters.build_localiser(case.other.sonar_in_base)
        localiser.restore(stored, False)
        elsewhere = (moved(scan, frame) for scan in scans[first : first + _MOST_SCANS])
        found.append(started(localiser, elsewhere, case.truth))
    return found


def line(found: Sequence[Start]) -> str:
    """Return the figures of some starts for people."""
    good = [one for one in found if one.scans is not None]
    if not good:
        return f"called good 0 of {len(found)}"
    scans, errors, stated = np.array(good, dtype=float).T
    wrong = sum(one.is_wrong for one in good)
    return (
        f"called good {len(good)} of {len(found)}, wrong {wrong}; after {np.median(scans):.0f} scans in the middle, "
        f"{scans.max():.0f} at most; error {np.median(errors):.2f} m in the middle, {errors.max():.2f} at most; "
        f"stated {np.median(stated):.2f} m"
    )


def main() -> None:
    """Print one line per case."""
    parser = benchmark_parser("lost", __doc__)
    parser.add_argument("--starts", type=int, default=20, help="in each map (default: %(default)s)")
    parser.add_argument("--cases", nargs="*", default=list(CASES), choices=list(CASES), metavar="CASE")
    arguments = parser.parse_args()
    made: Dict[Tuple[object, ...], Case] = {}
    for name in arguments.cases:
        make, of, share = CASES[name]
        if (make, of) not in made:
            made[make, of] = make(*of)
        count = min(arguments.starts, _CANAL_STARTS) if make is canal_case else arguments.starts
        print(f"{name}: {line(starts(made[make, of], share, count))}", flush=True)
