"""The thesis's three moves in the basin (7.4), with both matchers, and how honest the covariance is."""

from typing import Dict, List, Tuple

import numpy as np
import yaml
from scipy.stats import chi2

from benchmarks.matchers import MATCHERS, MatcherName
from benchmarks.matching_scans import KINDS, ROOT, ScanMaker, SonarKind
from benchmarks.table import Row
from mlsm_manager.localisation.estimator import MapSettings
from mlsm_manager.localisation.scan_by_scan import ScanByScan
from mlsm_manager.scan_matching.prediction import OdometryErrors
from mlsm_manager.scan_matching.scan import Scan, Track
from sonar_simulator.vehicle.scripted_vehicle import VehicleScript

SEEDS = 30
TURNS = 7
SETTINGS = MapSettings(0.5, 0.5, 1e4, 1000, 15)
ODOMETRY = OdometryErrors(scale_deviation=0.3)
_SCALE = 1.3
_SCRIPT = yaml.safe_load((ROOT / "yaml/thesis_moves.yaml").read_text())
_VEHICLE = VehicleScript.from_yaml_data(_SCRIPT["moves"], _SCRIPT["start"])


def true_path(times: np.ndarray) -> np.ndarray:
    """Return the true planar poses (n, 3) of the thesis's moves."""
    return np.array([[pose[0, 3], pose[1, 3], 0.0] for pose in map(_VEHICLE.pose, times)])


def odometry_path(times: np.ndarray) -> np.ndarray:
    """Return the poses (n, 3) as odometry of 30 % error has them."""
    return true_path(times) / [_SCALE, _SCALE, 1.0]


def session_track() -> Track:
    """Return the odometry of the moves."""
    times = np.linspace(-1.0, _VEHICLE.duration, 2400)
    return Track(times, odometry_path(times))


def session_scans(maker: ScanMaker, seed: int, track: Track) -> List[Scan]:
    """Return one scan per turn of the head; every second one sees a whole move."""
    return [
        maker.scan(true_path, odometry_path, 100 * seed + turn, turn, moving=bool(turn % 2), track=track)
        for turn in range(TURNS)
    ]


def session_estimator(name: MatcherName) -> ScanByScan:
    """Return an estimator that matches with default parameters and knows how wrong the odometry may be."""
    estimator = ScanByScan(SETTINGS, ODOMETRY, MATCHERS[name]())
    estimator.matching = True
    return estimator


def session_errors(scans: List[Scan], name: MatcherName) -> np.ndarray:
    """Return (scans - 1, 5): accepted, distance [m] and angle [rad] from the truth, squared Mahalanobis distance, s.

    Where a match was not accepted, the pose is the one that the matcher offered.
    """
    estimator = session_estimator(name)
    rows = []
    for scan in scans:
        update = estimator.add_scan(scan)
        if update.result is None:
            continue
        difference = update.result.pose - true_path(np.array([scan.reference_time]))[0]
        squared = difference @ np.linalg.solve(update.belief.covariance[:3, :3], difference)
        distance = np.hypot(*difference[:2])
        rows.append([update.accepted, distance, abs(difference[2]), squared, update.result.seconds])
    return np.array(rows)


def sessions(kind: SonarKind, first_seed: int = 0) -> Dict[MatcherName, np.ndarray]:
    """Return (SEEDS, scans, 5) of `session_errors` for each matcher; both see the same scans."""
    maker = ScanMaker("basin", kind)
    track = session_track()
    scans = [session_scans(maker, seed, track) for seed in range(first_seed, first_seed + SEEDS)]
    return {name: np.array([session_errors(session, name) for session in scans]) for name in MatcherName}


def move_rows(kind: SonarKind, name: MatcherName, errors: np.ndarray) -> List[Row]:
    """Return the figures of one matcher: all fixes of all seeds."""
    every = errors.reshape(-1, 5)
    accepted = every[every[:, 0] > 0]
    wanted = name is MatcherName.DISTRIBUTIONS
    title = f"thesis moves, basin, {kind}, {name.value}"
    rows = [(f"{title}: fixes accepted", f"{len(accepted)} of {len(every)}", "")]
    shown, what = (accepted, "") if len(accepted) else (every, " (rejected)")
    for label, quantile, meters, degrees in (("median", 0.5, 0.05, 0.25), ("95th percentile", 0.95, 0.12, 0.6)):
        distance, angle = np.quantile(shown[:, 1], quantile), np.degrees(np.quantile(shown[:, 2], quantile))
        limit = f"<= {meters:g} m, {degrees:g} deg" if wanted else ""
        rows.append((f"{title}: {label} error{what}", f"{distance:.3f} m, {angle:.3f} deg", limit))
    rows.append((f"{title}: time of a match", f"{1e3 * np.median(every[:, 4]):.0f} ms", ""))
    return rows


def consistency_row(kind: SonarKind, errors: np.ndarray) -> Row:
    """Return the mean normalised estimation error squared of the last accepted fix of each seed.

    Fixes of one seed share a map, so that only one of them counts.
    """
    last = [rows[rows[:, 0] > 0][-1, 3] for rows in errors if (rows[:, 0] > 0).any()]
    if not last:
        return (f"NEES of the pose, {kind}", "no fix accepted", "")
    low, high = nees_band(len(last))
    return (f"NEES of the pose, {kind}, {len(last)} seeds", f"{np.mean(last):.2f}", f"{low:.2f} to {high:.2f}")


def nees_band(count: int) -> Tuple[float, float]:
    """Return the 95 % band of the mean of `count` independent normalised squares of three states."""
    low, high = chi2.ppf([0.025, 0.975], 3 * count) / count
    return float(low), float(high)


def rows(first_seed: int = 0) -> List[Row]:
    """Return the figures of the moves."""
    result: List[Row] = []
    for kind in KINDS:
        by_matcher = sessions(kind, first_seed)
        for name, errors in by_matcher.items():
            result += move_rows(kind, name, errors)
        result.append(consistency_row(kind, by_matcher[MatcherName.DISTRIBUTIONS]))
    return result
