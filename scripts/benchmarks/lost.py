"""Whether a vehicle that knows nothing of its place finds itself in a stored map, and whether it is right.

Each map is drawn with an exact odometry, whole or of the first part of a tour. A vehicle is then put into it at many
moments of another tour of the same water, with an odometry of usual errors in a frame of its own. It takes scans until
its position is called good, at most fifteen. A position is wrong if it is off by more than 3 m and by more than four
times what is stated. After half of a tour some vehicles are where the map has nothing: these should not be called good.
"""

import re
from typing import Iterable, Iterator, NamedTuple, Optional, Tuple

import numpy as np

from benchmarks.live_faults import is_called_good
from benchmarks.paths import replay_input
from benchmarks.tours import simulated
from mlsm_manager.localisation.joint_session import moved
from mlsm_manager.localisation.localiser import Localiser
from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.scan_matching.scan import Scan, Track

_MOST_SCANS = 15
_WRONG, _SURE = 3.0, 4.0  # m, stated deviations
_FAR = 100.0  # m, by which the odometry's frame is elsewhere
_NOWHERE = 1e4  # m, where no map is


class Case(NamedTuple):
    """mapped, other: tours of the map and of the vehicle. share: how much of its tour the map has. scale: see
    TwinParameters, of the vehicle's odometry.
    """

    mapped: str
    other: str
    share: float = 1.0
    scale: Optional[float] = None


_CASES = {
    "basin": Case("basin", "basin"),
    "basin, half of the tour": Case("basin", "basin", 0.5),
    "basin, two thirds of the tour": Case("basin", "basin", 0.67),
    "harbour": Case("harbour", "harbour"),
    "harbour, half of the tour": Case("harbour", "harbour", 0.5),
    "harbour ahead, odometry 30 % off": Case("harbour_ahead", "harbour_ahead", scale=0.3),
    "basin, vehicle in the harbour": Case("basin", "harbour"),
    "harbour, vehicle in the basin": Case("harbour", "basin"),
}


def _started(localiser: Localiser, scans: Iterable[Scan], truth: Track) -> Optional[Tuple[int, float, float]]:
    """Feed a localiser that is lost until it calls its position good; None where it never does.

    Returns the number of scans until then, and error and stated deviation [m] of the position.
    """
    for count, scan in enumerate(scans, 1):
        update = localiser.take_scan(scan).scan
        place = localiser.place_now(scan.reference_time, scan.reference_pose)
        if is_called_good(localiser, place, update.provisional):
            error = update.belief.theta[:2] - truth.at(np.array([scan.reference_time]))[0, :2]
            return count, float(np.hypot(*error)), place.deviation
    return None


def _starts(case: Case, count: int) -> Iterator[Optional[Tuple[int, float, float]]]:
    """Yield what came of `count` starts all along the other tour; see _started."""
    tour = simulated(f"{case.mapped}_tour", seed=1)
    recording = tour.recording(tour.truth)
    scans, parameters = replay_input(recording, OdometryKind.AUTO)
    drawing = parameters.build_localiser(recording.sonar_in_base)
    for scan in scans[: int(case.share * len(scans))]:
        drawing.take_scan(scan)
    stored = drawing.stored("map", {}, 0.0, "")

    tour = simulated(f"{case.other}_tour", seed=2)
    other = tour.with_dvl(2) if case.scale is None else tour.with_dvl(2, scale=case.scale)
    elsewhere = np.array([_NOWHERE if case.mapped != case.other else 0.0, 0.0, 0.0])
    truth = Track(tour.truth.times, tour.truth.poses + elsewhere)
    scans, _ = replay_input(other, OdometryKind.AUTO)
    rng = np.random.RandomState(5)
    for first in (np.linspace(0.0, 0.9, count) * len(scans)).astype(int):
        frame = np.append(rng.uniform(-_FAR, _FAR, 2), rng.uniform(-np.pi, np.pi))
        localiser = parameters.build_localiser(other.sonar_in_base)
        localiser.restore(stored, False)
        yield _started(localiser, (moved(scan, frame) for scan in scans[first : first + _MOST_SCANS]), truth)


def lines(rows: str = ".", starts: int = 20) -> Iterator[str]:
    """Yield the cases that a regular expression finds. starts: in each map."""
    for name, case in _CASES.items():
        if not re.search(rows, name):
            continue
        good = [one for one in _starts(case, starts) if one is not None]
        if not good:
            yield f"{name}: called good 0 of {starts}"
            continue
        scans, errors, stated = np.array(good, dtype=float).T
        wrong = np.count_nonzero(errors > np.maximum(_WRONG, _SURE * stated))
        yield (
            f"{name}: called good {len(good)} of {starts}, wrong {wrong}; after {np.median(scans):.0f} scans in the "
            f"middle, {scans.max():.0f} at most; error {np.median(errors):.2f} m in the middle, {errors.max():.2f} at "
            f"most; stated {np.median(stated):.2f} m"
        )
