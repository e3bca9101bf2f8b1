"""From how far a scan finds its place, and how long that takes."""

import time
from dataclasses import dataclass
from typing import List

import numpy as np
import yaml

from benchmarks.matching_scans import KINDS, ROOT, ScanMaker, SonarKind, still
from benchmarks.table import Row
from mlsm_manager.scan_matching.distribution_matcher import DistributionMatcher, DistributionMatcherParameters
from mlsm_manager.scan_matching.result import Matcher, MatchResult, Prior
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry import composed, inverse, wrapped
from sonar_simulator.vehicle.scripted_vehicle import VehicleScript

STARTS = 100
NEAR, NEAR_YAW = 0.5, np.radians(3.0)
_FIXED = 1e-3
WIDE = {"search_distance": 6.5, "search_angle": float(np.radians(48.0)), "candidates": 12}


def tour_map(maker: ScanMaker) -> Blocks:
    """Return the map of the basin's tour: a still scan wherever the vehicle rests."""
    surface_map = MultiLevelSurfaceMap(0.5)
    for number, pose in enumerate(tour_stops()):
        surface_map.insert(maker.scan(still(pose), still(pose), seed=number).points)
    return surface_map.blocks


def tour_stops() -> np.ndarray:
    """Return (n, 3) the places where the vehicle of the basin's tour rests."""
    script = yaml.safe_load((ROOT / "yaml/basin_tour.yaml").read_text())
    vehicle = VehicleScript.from_yaml_data(script["moves"], script["start"])
    times = np.arange(8.0, vehicle.duration, 48.0)
    poses = [vehicle.pose(time) for time in times]
    return np.array([[pose[0, 3], pose[1, 3], np.arctan2(pose[1, 0], pose[0, 0])] for pose in poses])


def start_rows(kind: SonarKind, first_seed: int = 0) -> List[Row]:
    """Return how many of the starts converge, narrow and wide."""
    maker = ScanMaker("basin", kind)
    target = tour_map(maker)
    rows: List[Row] = []
    for distance, angle, changes, limit in ((3.0, 20.0, {}, 50), (6.0, 45.0, WIDE, 100)):
        matcher = DistributionMatcher(DistributionMatcherParameters().changed(changes))
        seeds = range(first_seed, first_seed + STARTS)
        starts = [started(maker, target, matcher, distance, np.radians(angle), seed) for seed in seeds]
        found = np.array([one.found for one in starts])
        accepted = np.array([one.result.accepted for one in starts])
        seconds = [one.seconds for one in starts]
        title = f"starts {distance:g} m and {angle:g} deg off, basin, {kind}"
        rows.append((f"{title}: converge", f"{found.sum()} of {STARTS}", ">= 99"))
        rows.append((f"{title}: accepted elsewhere", f"{(accepted & ~found).sum()} of {STARTS}", "0"))
        rows.append((f"{title}: time of a core", f"{1e3 * np.median(seconds):.0f} ms", f"<= {limit} ms"))
    return rows


@dataclass(frozen=True)
class Start:
    """What came of a match of a scan that was taken at a true pose (3,). seconds: of a core."""

    true_pose: np.ndarray
    result: MatchResult
    seconds: float

    @property
    def error(self) -> float:
        """Distance from the true place, m."""
        return float(np.hypot(*(self.result.pose - self.true_pose)[:2]))

    @property
    def found(self) -> bool:
        """Whether the match was accepted and is at the true place."""
        yaw = abs(float(wrapped(self.result.pose[2] - self.true_pose[2])))
        return self.result.accepted and self.error < NEAR and yaw < NEAR_YAW


def started(maker: ScanMaker, target: Blocks, matcher: Matcher, distance: float, angle: float, seed: int) -> Start:
    """Match a scan taken near a stop of the tour, from an expectation that is `distance` [m] and `angle` [rad] off."""
    rng = np.random.default_rng(seed)
    stops = tour_stops()
    pose = stops[seed % len(stops)] + rng.uniform([-3.0, -3.0, -0.5], [3.0, 3.0, 0.5])
    scan = maker.scan(still(pose), still(pose), seed=1000 + seed)
    bearing = rng.uniform(-np.pi, np.pi)
    expected = pose + np.array([distance * np.cos(bearing), distance * np.sin(bearing), rng.choice([-angle, angle])])
    deviations = np.array([distance / 1.5, distance / 1.5, angle / 1.5, _FIXED, _FIXED, _FIXED / 10.0, _FIXED, _FIXED])
    prior = Prior(composed(expected, inverse(pose)), np.zeros(3), np.zeros(2), np.diag(deviations**2))
    begin = time.thread_time()
    result = matcher.match(scan, target, prior)
    seconds = time.thread_time() - begin
    return Start(pose, result, seconds)


def rows(first_seed: int = 0) -> List[Row]:
    """Return the figures of the starts."""
    return [row for kind in KINDS for row in start_rows(kind, first_seed)]
