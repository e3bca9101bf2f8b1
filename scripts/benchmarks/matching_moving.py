"""A vehicle that never stops: 0.3 m/s and 2 deg/s, and an odometry whose velocity is 30 % wrong."""

from typing import List

import numpy as np

from benchmarks.matching_moves import SETTINGS
from benchmarks.matching_scans import KINDS, ScanMaker, SonarKind, still
from benchmarks.table import Row
from mlsm_manager.localisation.mapper import Mapper
from mlsm_manager.matching.matchers.distribution_matcher import DistributionMatcher
from mlsm_manager.matching.matchers.parameters import DistributionMatcherParameters
from mlsm_manager.matching.problem.prediction import OdometryErrors
from mlsm_manager.matching.problem.scan import Track
from node_support.geometry.planar import wrapped

SEEDS = 30
TURNS = 5
_SPEED, _TURN_RATE, _WRONG = 0.3, np.radians(2.0), 0.7
_START = 16.0
_ERRORS = OdometryErrors(scale_deviation=0.3, turn_rate_deviation=0.01, rate_time=600.0)


def circle(speed: float, turn_rate: float, times: np.ndarray) -> np.ndarray:
    """Return the poses (n, 3) of a vehicle that waits for one turn of the head and then runs on a circle."""
    seconds = np.maximum(times - _START, 0.0)
    yaw = turn_rate * seconds
    radius = speed / turn_rate
    return np.column_stack([radius * np.sin(yaw), radius * (1.0 - np.cos(yaw)), yaw])


def run(maker: ScanMaker, seed: int) -> np.ndarray:
    """Return (n, 3) squared errors of distance, yaw and speed at every beam of the matched scans; NaN if rejected."""

    def truth(times: np.ndarray) -> np.ndarray:
        return circle(_SPEED, _TURN_RATE, times)

    def odometry(times: np.ndarray) -> np.ndarray:
        return circle(_SPEED * _WRONG, _TURN_RATE * _WRONG, times)

    times = np.linspace(-1.0, 16.0 * (TURNS + 1), 2400)
    track = Track(times, odometry(times))
    mapper = Mapper(SETTINGS, _ERRORS, DistributionMatcher(DistributionMatcherParameters()))
    mapper.matching = True
    mapper.take_echoes(maker.scan(still(np.zeros(3)), still(np.zeros(3)), 100 * seed, 0, track=track))
    rows = []
    for turn in range(1, TURNS):
        scan = maker.scan(truth, odometry, 100 * seed + turn, turn, moving=True, track=track)
        result = mapper.take_echoes(scan).result
        if result is None or not result.accepted:
            rows.append(np.full((1, 3), np.nan))
            continue
        difference = result.beam_poses - truth(result.beam_times)
        speed = np.full(len(difference), np.hypot(*(result.velocity[:2] - [_SPEED, 0.0])))
        squares = [(difference[:, :2] ** 2).sum(axis=1), wrapped(difference[:, 2]) ** 2, speed**2]
        rows.append(np.column_stack(squares))
    return np.concatenate(rows)


def moving_rows(kind: SonarKind, first_seed: int = 0) -> List[Row]:
    """Return the figures of the moving scans."""
    maker = ScanMaker("basin", kind)
    runs = [run(maker, seed) for seed in range(first_seed, first_seed + SEEDS)]
    rejected = sum(int(np.isnan(squares[:, 0]).sum()) for squares in runs)
    matched = [squares[np.isfinite(squares[:, 0])] for squares in runs]
    errors = np.array([np.sqrt(squares.mean(axis=0)) for squares in matched if len(squares)])
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
