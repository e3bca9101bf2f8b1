"""A vehicle that never stops: 0.3 m/s and 2 deg/s, and an odometry whose velocity is 30 % wrong."""

from typing import List

import numpy as np

from benchmarks.matchers import MATCHERS, MatcherName
from benchmarks.matching_moves import SETTINGS
from benchmarks.matching_scans import KINDS, ScanMaker, SonarKind, still
from benchmarks.table import Row
from mlsm_manager.localisation.scan_by_scan import ScanByScan
from mlsm_manager.scan_matching.prediction import OdometryErrors
from mlsm_manager.scan_matching.result import MatchResult
from mlsm_manager.scan_matching.scan import Scan, Track
from node_support.geometry import wrapped

SEEDS = 30
TURNS = 5
SPEED, TURN_RATE, WRONG = 0.3, np.radians(2.0), 0.7
_START = 16.0
_ERRORS = OdometryErrors(scale_deviation=0.3, turn_rate_deviation=0.01, rate_time=600.0)


def circle(speed: float, turn_rate: float, times: np.ndarray) -> np.ndarray:
    """Return the poses (n, 3) of a vehicle that waits for one turn of the head and then runs on a circle."""
    seconds = np.maximum(times - _START, 0.0)
    yaw = turn_rate * seconds
    radius = speed / turn_rate
    return np.column_stack([radius * np.sin(yaw), radius * (1.0 - np.cos(yaw)), yaw])


def true_path(times: np.ndarray) -> np.ndarray:
    """Return the true poses (n, 3)."""
    return circle(SPEED, TURN_RATE, times)


def odometry_path(times: np.ndarray) -> np.ndarray:
    """Return the poses (n, 3) as the odometry has them."""
    return circle(SPEED * WRONG, TURN_RATE * WRONG, times)


def moving_scans(maker: ScanMaker, seed: int) -> List[Scan]:
    """Return a scan at rest and those of the circle."""
    times = np.linspace(-1.0, 16.0 * (TURNS + 1), 2400)
    track = Track(times, odometry_path(times))
    first = maker.scan(still(np.zeros(3)), still(np.zeros(3)), 100 * seed, 0, track=track)
    return [first] + [
        maker.scan(true_path, odometry_path, 100 * seed + turn, turn, moving=True, track=track)
        for turn in range(1, TURNS)
    ]


def moving_estimator(name: MatcherName) -> ScanByScan:
    """Return an estimator that matches with default parameters and knows how wrong the odometry may be."""
    estimator = ScanByScan(SETTINGS, _ERRORS, MATCHERS[name]())
    estimator.matching = True
    return estimator


def matches(scans: List[Scan], name: MatcherName) -> List[MatchResult]:
    """Return what came of matching all scans but the first one, which makes the map."""
    estimator = moving_estimator(name)
    estimator.add_scan(scans[0])
    return [estimator.add_scan(scan).result for scan in scans[1:]]


def squared_errors(result: MatchResult) -> np.ndarray:
    """Return (n, 3) squared errors of distance, yaw and speed at every beam of a matched scan."""
    difference = result.beam_poses - true_path(result.beam_times)
    speed = np.full(len(difference), np.hypot(*(result.velocity[:2] - [SPEED, 0.0])))
    return np.column_stack([(difference[:, :2] ** 2).sum(axis=1), wrapped(difference[:, 2]) ** 2, speed**2])


def root_mean_square(results: List[MatchResult]) -> np.ndarray:
    """Return (3,) root mean squares of the errors over all beams."""
    return np.sqrt(np.concatenate([squared_errors(result) for result in results]).mean(axis=0))


def moving_rows(kind: SonarKind, first_seed: int = 0) -> List[Row]:
    """Return the figures of the moving scans."""
    maker = ScanMaker("basin", kind)
    seeds = range(first_seed, first_seed + SEEDS)
    runs = [matches(moving_scans(maker, seed), MatcherName.DISTRIBUTIONS) for seed in seeds]
    accepted = [[result for result in results if result.accepted] for results in runs]
    rejected = sum(map(len, runs)) - sum(map(len, accepted))
    errors = np.array([root_mean_square(results) for results in accepted if results])
    position, yaw, speed = np.median(errors, axis=0) if len(errors) else np.full(3, np.nan)
    title = f"moving 0.3 m/s, 2 deg/s, velocity 30 % wrong, basin, {kind}"
    return [
        (f"{title}: scans rejected", f"{rejected} of {SEEDS * (TURNS - 1)}", ""),
        (f"{title}: trajectory RMSE, median", f"{position:.3f} m, {np.degrees(yaw):.3f} deg", "<= 0.10 m, 0.3 deg"),
        (f"{title}: velocity RMSE, median", f"{100 * speed:.2f} cm/s", "<= 1.5 cm/s"),
    ]


def rows(first_seed: int = 0) -> List[Row]:
    """Return the figures of moving scans."""
    return [row for kind in KINDS for row in moving_rows(kind, first_seed)]
