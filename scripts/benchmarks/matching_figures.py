"""Matching one scan: from how far off it finds its place, and whether one that has no place, or several, is refused."""

import time
from dataclasses import replace
from functools import lru_cache, partial
from typing import Callable, Dict, Iterator, Tuple

import numpy as np
import yaml

from benchmarks.harness import ROOT, Row
from benchmarks.matchers import BEAM_WIDTH
from benchmarks.scans import KINDS, ScanMaker, SonarKind, noise_scan, still
from mlsm_manager.scan_matching.distribution_matcher import NEARBY, DistributionMatcher
from mlsm_manager.scan_matching.scan import Belief, Scan
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry import wrapped
from sonar_simulator.simulation.scripted_vehicle import VehicleScript

_STARTS = 100
_NEAR, _NEAR_YAW = 0.5, np.radians(3.0)
_FIXED = np.array([1e-3, 1e-3, 1e-4, 1e-3, 1e-3])  # deviations of what is known
_SCANS = 250  # in each situation without a place
_WIDE = {"search_distance": 6.5, "search_angle": float(np.radians(48.0)), "candidates": 12}
_SIGMAS = 4.0
_DEVIATIONS = np.append([1.5, 1.5, 0.15], _FIXED)
Case = Tuple[Scan, Blocks, np.ndarray]
"""A scan, a map and the true pose (3,) in it."""


def _tour_map(maker: ScanMaker) -> Blocks:
    """Return the map of the basin's tour: a still scan wherever the vehicle rests."""
    surface_map = MultiLevelSurfaceMap(0.5)
    for number, pose in enumerate(_tour_stops()):
        surface_map.insert(maker.scan(still(pose), still(pose), seed=number).points)
    return surface_map.blocks


@lru_cache(maxsize=None)
def _tour_stops() -> np.ndarray:
    """Return (n, 3) the places where the vehicle of the basin's tour rests."""
    script = yaml.safe_load((ROOT / "yaml/basin_tour.yaml").read_text())
    vehicle = VehicleScript.from_yaml_data(script["moves"], script["start"])
    poses = [vehicle.pose(time) for time in np.arange(8.0, vehicle.duration, 48.0)]
    return np.array([[pose[0, 3], pose[1, 3], np.arctan2(pose[1, 0], pose[0, 0])] for pose in poses])


def _start_rows(kind: SonarKind, seeds: range) -> Iterator[Row]:
    """Yield how many of the starts converge, narrow and wide."""
    maker = ScanMaker("basin", kind)
    target = _tour_map(maker)
    for distance, angle, changes, limit in ((3.0, 20.0, {}, 50), (6.0, 45.0, _WIDE, 100)):
        matcher = DistributionMatcher(replace(NEARBY, **changes), BEAM_WIDTH, 0.0)
        cases = [_start(maker, distance, np.radians(angle), seed) for seed in seeds]
        results, times = [], [time.thread_time()]
        for scan, belief, _ in cases:
            results.append(matcher.match(scan, target, belief))
            times.append(time.thread_time())
        off = np.array([result.pose - true for result, (_, _, true) in zip(results, cases)])
        found = (np.hypot(*off[:, :2].T) < _NEAR) & (np.abs(wrapped(off[:, 2])) < _NEAR_YAW)
        accepted = np.array([result.accepted for result in results])
        title = f"starts {distance:g} m and {angle:g} deg off, basin, {kind}"
        yield f"{title}: converge", f"{(accepted & found).sum()} of {_STARTS}", f">= {0.99 * _STARTS:g}"
        yield f"{title}: accepted elsewhere", f"{(accepted & ~found).sum()} of {_STARTS}", "0"
        yield f"{title}: time of a core", f"{1e3 * np.median(np.diff(times)):.0f} ms", f"<= {limit} ms"


def _start(maker: ScanMaker, distance: float, angle: float, seed: int) -> Tuple[Scan, Belief, np.ndarray]:
    """Return a scan from near a stop of the tour, an expectation that far [m, rad] off, and the true pose (3,)."""
    rng = np.random.default_rng(seed)
    stops = _tour_stops()
    pose = stops[seed % len(stops)] + rng.uniform([-3.0, -3.0, -0.5], [3.0, 3.0, 0.5])
    bearing = rng.uniform(-np.pi, np.pi)
    expected = pose + np.array([distance * np.cos(bearing), distance * np.sin(bearing), rng.choice([-angle, angle])])
    deviations = np.append(np.array([distance, distance, angle]) / 1.5, _FIXED)
    scan = maker.scan(still(pose), still(pose), seed=1000 + seed)
    return scan, _belief(scan, expected, deviations), pose


def _belief(scan: Scan, expected: np.ndarray, deviations: np.ndarray) -> Belief:
    return Belief(scan.reference_time, np.append(expected, np.zeros(5)), np.diag(deviations**2))


def _cases(kind: SonarKind) -> Dict[str, Callable[[int], Case]]:
    """Return for each situation what makes its case number n."""
    makers = {name: ScanMaker(name, kind) for name in ("basin", "empty sea", "straight wall")}
    basin = _tour_map(makers["basin"])

    def alone(world: str, seed: int) -> Case:
        rng = np.random.default_rng(seed)
        first, second = np.zeros(3), rng.uniform([-5.0, -2.0, -0.2], [5.0, 2.0, 0.2])
        surface_map = MultiLevelSurfaceMap(0.5)
        surface_map.insert(makers[world].scan(still(first), still(first), 2 * seed).points)
        return makers[world].scan(still(second), still(second), 2 * seed + 1), surface_map.blocks, second

    def noise(seed: int) -> Case:
        return noise_scan(int(np.random.default_rng(seed).integers(30, 300)), seed), basin, np.zeros(3)

    def elsewhere(seed: int) -> Case:
        rng = np.random.default_rng(seed)
        believed = rng.uniform([-45.0, -12.0, -3.1], [45.0, 12.0, 3.1])
        true = np.array([-np.sign(believed[0]) * rng.uniform(20.0, 45.0), rng.uniform(-12.0, 12.0), believed[2] + 1.6])
        return makers["basin"].scan(still(true), still(believed), seed), basin, true

    return {
        "an empty sea": partial(alone, "empty sea"),
        "a single straight wall": partial(alone, "straight wall"),
        "pure noise": noise,
        "a map of another place": elsewhere,
    }


def _false_rows(kind: SonarKind, seeds: range) -> Iterator[Row]:
    """Yield how many scans were accepted with a covariance that excludes the truth."""
    matcher = DistributionMatcher(NEARBY, BEAM_WIDTH, 0.0)
    for title, make in _cases(kind).items():
        outcomes = [_outcome(matcher, make(seed), seed) for seed in seeds]
        wrong, accepted = np.sum(outcomes, axis=0)
        yield f"false fixes on {title}, {kind}", f"{wrong} of {_SCANS} ({accepted} accepted)", "0"


def _outcome(matcher: DistributionMatcher, case: Case, seed: int) -> Tuple[bool, bool]:
    scan, target, true = case
    rng = np.random.default_rng(seed)
    expected = scan.reference_pose + rng.normal(0.0, _DEVIATIONS[:3])
    result = matcher.match(scan, target, _belief(scan, expected, _DEVIATIONS))
    if not result.accepted:
        return False, False
    difference = result.pose - true
    squared = difference @ np.linalg.solve(result.covariance[:3, :3], difference)
    return bool(squared > _SIGMAS**2), True


def rows(first_seed: int = 0) -> Iterator[Row]:
    """Yield all figures, drawn with the seeds from `first_seed` on; some minutes."""
    for kind in KINDS:
        yield from _start_rows(kind, range(first_seed, first_seed + _STARTS))
    for kind in KINDS:
        yield from _false_rows(kind, range(first_seed, first_seed + _SCANS))
